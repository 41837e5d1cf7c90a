# SPDX-License-Identifier: Apache-2.0
"""Parameters of the diff-drive controller."""

from dataclasses import dataclass

from wasd_core.parameters import parameter

from diff_drive_sim.limit_parameters import LimitParameters
from diff_drive_sim.odometry_parameters import OdometryParameters
from diff_drive_sim.wheel_parameters import WheelParameters


@dataclass(frozen=True, kw_only=True)
class DiffDriveParameters(OdometryParameters, LimitParameters, WheelParameters):
    """Everything that can be set; the wheels' geometry comes from the robot's description."""

    description: str = parameter(
        'mbot',
        doc='Robot whose wheels are driven: a built-in name, or a xacro or URDF file; '
        'not used when the controller is composed with a simulator',
        read_only=True,
    )
    controller: str = parameter(
        '',
        doc="YAML file with parameters: arbotix's, ros2_controllers' or a ROS 2 parameter file",
        read_only=True,
    )
    cmd_vel_timeout: float = parameter(
        0.5,
        doc='The robot stops when cmd_vel is silent for so long; 0 is never',
        unit='s',
        minimum=0.0,
    )
    stamped: str = parameter(
        'auto',
        doc='Type of cmd_vel: Twist (false), TwistStamped (true), or whatever comes, both at once',
        choices=('auto', 'true', 'false'),
        read_only=True,
    )
    publish_limited_velocity: bool = parameter(
        False, doc='Publish the velocity within the limits on ~/cmd_vel_out', read_only=True
    )
    update_rate: float = parameter(
        200.0,
        doc='Rate of the controller in lock-step and in mode fake; mode arbotix has 500',
        unit='Hz',
        above=0.0,
        read_only=True,
    )
    diagnostic_rate: float = parameter(
        1.0, doc='Rate of diagnostics; 0: none', unit='Hz', minimum=0.0, read_only=True
    )
