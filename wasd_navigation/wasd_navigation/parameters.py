# SPDX-License-Identifier: Apache-2.0
"""Parameters of the navigator; names of slam_toolbox and Nav2 where they have one."""

from dataclasses import dataclass
from functools import cached_property
import math

import numpy as np
from wasd_core.command_line import Executable
from wasd_core.errors import UserError
from wasd_core.parameters import fixed, group, parameter, Parameters

# Circles along the edge of a rectangle reach inward so far [m].
_DEPTH = 0.11
navigator = Executable(
    name='navigator',
    module='wasd_navigation.navigator_node',
    node='NavigatorNode',
    joins=True,
    about='Maps or localises with scan and odom; drives to goal_pose with cmd_vel.',
    parameters=('wasd_navigation.parameters:NavigatorParameters',),
    example='navigator --ros-args -p use_sim_time:=true -r cmd_vel:=nav_vel',
)


class InvalidFootprint(UserError):
    """A footprint that no robot has."""


@dataclass(frozen=True)
class Footprint:
    """
    A circle of a `radius`, or a rectangle of `half_length` (x) and `half_width` (y) [m].

    Both lie about the origin of the base frame, about which the robot turns.
    """

    radius: float = 0.0
    half_length: float = 0.0
    half_width: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is neither, or both."""
        sizes = (self.radius, self.half_length, self.half_width)
        circle, rectangle = sizes[0] > 0.0, min(sizes[1:]) > 0.0
        if circle == rectangle or not all(0.0 <= size < math.inf for size in sizes):
            raise InvalidFootprint(
                'a footprint must be a circle with a radius > 0 m or a rectangle with a '
                f'half_length and a half_width > 0 m, got {self}'
            )

    @property
    def is_circle(self) -> bool:
        """Whether it is the same whichever way the robot looks."""
        return self.radius > 0.0

    @property
    def inscribed(self) -> float:
        """Radius of the largest circle about the origin within it [m]."""
        return self.radius or min(self.half_length, self.half_width)

    @cached_property
    def circles(self) -> np.ndarray:
        """
        Circles that cover its edge, rows (x, y, radius) [m], shape (n, 3); one for a circle.

        What comes from outside meets one of them first. They reach beyond a rectangle by at most
        0.21 of their depth: 2.3 cm.
        """
        if self.is_circle:
            return np.array(((0.0, 0.0, self.radius),))
        depth = min(_DEPTH, self.half_length, self.half_width)
        middles = [_spread(half, depth) for half in (self.half_length, self.half_width)]
        xs, ys = middles
        edge = [(x, y) for x in xs for y in ys if x in (xs[0], xs[-1]) or y in (ys[0], ys[-1])]
        half_x = self.half_length - xs[-1]
        half_y = self.half_width - ys[-1]
        radius = math.hypot(half_x, half_y)
        return np.array([(x, y, radius) for x, y in edge])


def footprint_of(radius: float, length: float, width: float) -> Footprint:
    """Return a rectangle of a length and a width [m], or where both are 0 a circle of a radius."""
    if length > 0.0 or width > 0.0:
        return Footprint(half_length=0.5 * length, half_width=0.5 * width)
    return Footprint(radius=radius)


class SizeParameters(Parameters):
    """What of the floor a robot covers."""

    robot_radius: float = fixed(
        0.25, unit='m', minimum=0.02, maximum=5.0, doc='Radius of a round robot'
    )
    footprint_length: float = fixed(
        0.0,
        unit='m',
        minimum=0.02,
        or_zero=True,
        maximum=10.0,
        doc='Length of a robot that is not round, centred on its base frame; 0: round',
    )
    footprint_width: float = fixed(
        0.0, unit='m', minimum=0.02, or_zero=True, maximum=10.0, doc='Its width; 0: round'
    )

    @property
    def footprint(self) -> Footprint:
        """What of the floor the robot covers."""
        return footprint_of(self.robot_radius, self.footprint_length, self.footprint_width)


def _spread(half: float, depth: float) -> list[float]:
    """Return middles of equal parts of -half to half, each no longer than a depth."""
    count = max(1, math.ceil(2.0 * half / depth - 1e-9))
    width = 2.0 * half / count
    return [-half + width * (index + 0.5) for index in range(count)]


class MappingParameters(Parameters):
    """What scans are matched against, when places are kept, how the grid is drawn."""

    resolution: float = fixed(
        0.05, doc='Length of a cell of the map', unit='m', minimum=0.01, maximum=1.0
    )
    range_noise: float = fixed(
        0.012,
        minimum=0.001,
        maximum=0.5,
        doc="Smallest standard deviation of the lidar's ranges",
        unit='m',
    )
    range_noise_share: float = fixed(
        math.nan,
        minimum=0.0,
        maximum=0.2,
        doc='Standard deviation as a share of the range, if larger',
        nan='what scans show',
    )
    minimum_travel_distance: float = fixed(
        0.3,
        minimum=0.05,
        maximum=5.0,
        doc='Distance after which the mapper keeps a new place',
        unit='m',
    )
    minimum_travel_heading: float = fixed(
        0.35,
        minimum=0.05,
        maximum=3.2,
        doc='Turn after which the mapper keeps a new place',
        unit='rad',
    )
    scan_buffer_size: int = fixed(
        25,
        minimum=3,
        maximum=200,
        doc='Number of last places whose scans a scan is matched against',
    )
    loop_search_maximum_distance: float = fixed(
        2.5,
        minimum=0.1,
        maximum=20.0,
        doc='Largest distance to a place for closing a loop with it',
        unit='m',
    )
    loop_every: int = fixed(
        2, minimum=1, maximum=1000, doc='One of this many places is tried for closing a loop'
    )
    loop_match_minimum_chain_size: int = fixed(
        13, minimum=1, maximum=200, doc='Number of old places around a place for closing a loop'
    )


class DriveLimits(Parameters):
    """What may be asked of a robot's base; the defaults are mbot's."""

    forward: float = parameter(
        0.5, unit='m/s', minimum=0.01, maximum=10.0, doc='Largest speed ahead'
    )
    backward: float = parameter(
        0.2, unit='m/s', minimum=0.01, maximum=10.0, doc='Largest speed backward'
    )
    lateral: float = parameter(
        0.0,
        unit='m/s',
        minimum=0.0,
        maximum=10.0,
        doc='Largest speed sideways; 0: it cannot go sideways',
    )
    yaw: float = parameter(1.5, unit='rad/s', minimum=0.01, maximum=10.0, doc='Largest yaw rate')
    forward_acceleration: float = parameter(
        0.8,
        unit='m/s^2',
        minimum=0.05,
        maximum=100.0,
        doc='Largest acceleration ahead and backward',
    )
    lateral_acceleration: float = parameter(
        0.8, unit='m/s^2', minimum=0.05, maximum=100.0, doc='Largest acceleration sideways'
    )
    yaw_acceleration: float = parameter(
        3.0, unit='rad/s^2', minimum=0.05, maximum=100.0, doc='Largest change of the yaw rate'
    )
    lag: float = parameter(
        0.1, unit='s', minimum=0.0, maximum=2.0, doc='Time constant of following a command'
    )


class PlanningParameters(Parameters):
    """When a goal is reached, how far to keep off, when to give up."""

    xy_goal_tolerance: float = parameter(
        0.05,
        unit='m',
        minimum=0.005,
        maximum=5.0,
        doc='Largest distance from the goal that counts as arrived',
    )
    yaw_goal_tolerance: float = parameter(
        0.05,
        unit='rad',
        minimum=0.005,
        maximum=3.2,
        doc='Largest heading error that counts as arrived',
    )
    tolerance: float = parameter(
        0.3,
        unit='m',
        minimum=0.0,
        maximum=5.0,
        doc='Largest distance from a goal without room that counts as arrived',
    )
    margin: float = parameter(
        0.04,
        unit='m',
        minimum=0.0,
        maximum=2.0,
        doc='Smallest clearance around the footprint',
    )
    comfort: float = parameter(
        0.20,
        unit='m',
        minimum=0.01,
        maximum=5.0,
        doc='Preferred clearance around the footprint',
    )
    comfort_price: float = parameter(
        1.0,
        minimum=0.0,
        maximum=1000.0,
        doc='Extra cost of a metre without any comfort, in metres',
    )
    unknown_price: float = parameter(
        2.0,
        minimum=0.0,
        maximum=1000.0,
        doc='Extra cost of a metre of unknown space, in metres',
    )
    occupied: int = parameter(
        65, minimum=1, maximum=100, doc='Smallest occupancy of an obstacle cell'
    )
    silence: float = parameter(
        0.5,
        unit='s',
        minimum=0.05,
        maximum=10.0,
        doc='Time without a scan after which the robot stands',
    )
    stuck_time: float = parameter(
        5.0,
        unit='s',
        minimum=0.5,
        maximum=600.0,
        doc='Time without coming nearer after which it recovers',
    )
    recoveries: int = parameter(
        6,
        minimum=0,
        maximum=1000,
        doc='Recoveries in a row, without coming nearer, before it gives up',
    )
    samples: int = parameter(
        300, minimum=16, maximum=2000, doc='Number of motions sampled in each step'
    )
    horizon: int = parameter(
        30, minimum=5, maximum=100, doc='Length of each motion in tenths of a second'
    )


class NavigatorParameters(SizeParameters):
    """What the node needs beside what mapping and planning do."""

    map: str = fixed('', doc='Map to localise in, a YAML of map_server; empty: make one')
    continue_map: bool = fixed(
        False, doc='Continue to map in that map, with the places saved beside it'
    )
    keepout: str = fixed(
        '',
        doc='Mask of keepout areas, a YAML of map_server or PICTURE,METRES_PER_PIXEL; empty: none',
    )
    save_map: str = parameter(
        'map', doc='Name of the files of ~/save_map: .yaml, .pgm, .places.npz'
    )
    map_frame: str = fixed('map', doc='Frame of the map')
    control_frequency: float = fixed(
        20.0,
        unit='Hz',
        minimum=1.0,
        maximum=100.0,
        doc='Rate of velocity commands and of the transform from map to odom',
    )
    transform_tolerance: float = parameter(
        0.1,
        unit='s',
        minimum=0.0,
        maximum=10.0,
        doc='How far the transform from map to odom is post-dated',
    )
    stamped: bool = fixed(False, doc='Publish cmd_vel as TwistStamped, not Twist')
    mapping: MappingParameters = group(MappingParameters)
    limits: DriveLimits = group(DriveLimits)
    planning: PlanningParameters = group(PlanningParameters)
