# SPDX-License-Identifier: Apache-2.0
"""Parameters of the leg controller's node: the controller's own tuning, and what ROS adds."""

from dataclasses import dataclass

from wasd_core.parameters import parameter

from quadruped_sim.parameters import LegControllerParameters


@dataclass(frozen=True, kw_only=True)
class LegNodeParameters(LegControllerParameters):
    """Which robot, how it is estimated, its rates and frames; and the tuning, in groups."""

    description: str = parameter(
        'go2', doc='Robot: a built-in name, or a xacro or URDF file', read_only=True
    )
    estimator: str = parameter(
        'kalman',
        choices=('kalman', 'truth'),
        doc='Base state from IMU and legs, or from the simulator',
        read_only=True,
    )
    controller: str = parameter(
        '',
        doc='YAML file with parameters: a plain table or a ROS 2 parameter file',
        read_only=True,
    )
    update_rate: float = parameter(
        500.0, doc='Rate of the controller', unit='Hz', above=0.0, read_only=True
    )
    publish_rate: float = parameter(
        50.0, doc='Rate of odom and /tf', unit='Hz', above=0.0, read_only=True
    )
    odom_frame: str = parameter('odom', doc='Frame in which odometry is given', read_only=True)
    base_frame: str = parameter(
        '', doc="Frame of the robot that odometry follows; '' is its root link", read_only=True
    )
