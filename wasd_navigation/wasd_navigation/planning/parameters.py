# SPDX-License-Identifier: Apache-2.0
"""How a robot may move, and how it is driven to a point."""

from dataclasses import dataclass

from wasd_core.parameters import parameter
from wasd_core.parameters import Parameters


@dataclass(frozen=True, kw_only=True)
class DriveLimits(Parameters):
    """What may be asked of a robot's base; the defaults are mbot's."""

    forward: float = parameter(0.5, above=0.0, unit='m/s', doc='Largest speed ahead')
    backward: float = parameter(0.2, above=0.0, unit='m/s', doc='Largest speed backward')
    lateral: float = parameter(
        0.0, minimum=0.0, unit='m/s', doc='Largest speed sideways; 0: it cannot go sideways'
    )
    yaw: float = parameter(1.5, above=0.0, unit='rad/s', doc='Largest yaw rate')
    forward_acceleration: float = parameter(
        0.8, above=0.0, unit='m/s^2', doc='Largest acceleration ahead and backward'
    )
    lateral_acceleration: float = parameter(
        0.8, above=0.0, unit='m/s^2', doc='Largest acceleration sideways'
    )
    yaw_acceleration: float = parameter(
        3.0, above=0.0, unit='rad/s^2', doc='Largest change of the yaw rate'
    )
    lag: float = parameter(
        0.1, minimum=0.0, unit='s', doc='Time constant in which it follows a command'
    )


@dataclass(frozen=True, kw_only=True)
class PlanningParameters(Parameters):
    """When a goal is reached, how far to keep off, when to give up."""

    xy_goal_tolerance: float = parameter(
        0.05, above=0.0, unit='m', doc='Farthest from the goal that counts as there'
    )
    yaw_goal_tolerance: float = parameter(
        0.05, above=0.0, unit='rad', doc='Largest difference of heading that counts as there'
    )
    margin: float = parameter(
        0.04, minimum=0.0, unit='m', doc='Room that is always kept around the footprint'
    )
    comfort: float = parameter(
        0.20, above=0.0, unit='m', doc='Room around the footprint that is kept where there is any'
    )
    comfort_price: float = parameter(
        1.0, minimum=0.0, doc='What a metre without any comfort costs more, in metres'
    )
    unknown_price: float = parameter(
        2.0, minimum=0.0, doc='What a metre where nobody has looked costs more, in metres'
    )
    occupied: int = parameter(
        65, minimum=1, maximum=100, doc='Occupancy from which on a cell is an obstacle'
    )
    silence: float = parameter(
        0.5, above=0.0, unit='s', doc='Time without a scan after which the robot stands'
    )
    stuck_time: float = parameter(
        5.0, above=0.0, unit='s', doc='Time without coming nearer after which it recovers'
    )
    recoveries: int = parameter(
        6, minimum=0, doc='Recoveries in a row, without coming nearer, before it gives up'
    )
    samples: int = parameter(300, minimum=16, doc='Motions that are tried in each step')
    horizon: int = parameter(30, minimum=5, maximum=100, doc='Tenths of a second each looks ahead')
