# SPDX-License-Identifier: Apache-2.0
"""Parameters of the leg controller's node; the controller's own tuning is in `parameters`."""

from dataclasses import dataclass

from wasd_core.parameters import parameter
from wasd_core.parameters import Parameters


@dataclass(frozen=True, kw_only=True)
class LegNodeParameters(Parameters):
    """Which robot, how it is estimated, how fast it may be asked to go, and its frames."""

    description: str = parameter(
        'go2', doc='Robot: a built-in name, or a xacro or URDF file', read_only=True
    )
    estimator: str = parameter(
        'kalman',
        choices=('kalman', 'truth'),
        doc='Base state from IMU and legs, or from the simulator',
        read_only=True,
    )
    limits: str = parameter(
        'sport',
        choices=('sport', 'guide'),
        doc='Full stick: what the controller is good for, or what unitree_guide allows',
        read_only=True,
    )
    step_in_place: bool = parameter(
        False, doc='Trot on the spot at zero command instead of standing', read_only=True
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
