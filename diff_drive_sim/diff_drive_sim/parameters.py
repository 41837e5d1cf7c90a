# SPDX-License-Identifier: Apache-2.0
"""Parameters of the diff-drive controller."""

from dataclasses import dataclass

from robot_description.parameters import parameter
from robot_description.parameters import Parameters


@dataclass(frozen=True, kw_only=True)
class DiffDriveParameters(Parameters):
    """Limits, time-out, rates and frames; wheel geometry comes from the robot's description."""

    description: str = parameter(
        'mbot',
        doc='Robot whose wheels are driven: a built-in name, or a xacro or URDF file; '
        'not used when the controller is composed with a simulator',
        read_only=True,
    )
    cmd_vel_timeout: float = parameter(
        0.5,
        doc='The robot stops when cmd_vel is silent for so long; 0 is never',
        unit='s',
        minimum=0.0,
    )
    linear_velocity: float = parameter(
        1.0, doc='Largest forward and backward speed', unit='m/s', above=0.0
    )
    angular_velocity: float = parameter(4.0, doc='Largest yaw rate', unit='rad/s', above=0.0)
    linear_acceleration: float = parameter(
        1.0, doc='Largest change of speed', unit='m/s^2', above=0.0
    )
    angular_acceleration: float = parameter(
        6.0, doc='Largest change of yaw rate', unit='rad/s^2', above=0.0
    )
    wheel_damping: float = parameter(
        0.3,
        doc='Gain of the wheel speed loop: torque per speed error',
        unit='N m s/rad',
        above=0.0,
        read_only=True,
    )
    update_rate: float = parameter(
        200.0, doc='Rate of the controller in lock-step', unit='Hz', above=0.0, read_only=True
    )
    publish_rate: float = parameter(
        50.0, doc='Rate of odom and /tf', unit='Hz', above=0.0, read_only=True
    )
    odom_frame: str = parameter('odom', doc='Frame in which odometry is given', read_only=True)
    base_frame: str = parameter(
        'base_footprint', doc='Frame of the robot that odometry follows', read_only=True
    )
    stamped: bool = parameter(
        False, doc='cmd_vel is TwistStamped instead of Twist', read_only=True
    )
