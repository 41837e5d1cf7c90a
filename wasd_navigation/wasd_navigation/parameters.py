# SPDX-License-Identifier: Apache-2.0
"""Parameters of the navigator; names of slam_toolbox and Nav2 where they have one."""

from dataclasses import dataclass

from wasd_core.parameters import group
from wasd_core.parameters import parameter
from wasd_core.parameters import Parameters

from wasd_navigation.mapping.parameters import MappingParameters
from wasd_navigation.planning.footprint import Footprint
from wasd_navigation.planning.parameters import DriveLimits
from wasd_navigation.planning.parameters import PlanningParameters


@dataclass(frozen=True, kw_only=True)
class NavigatorParameters(Parameters):
    """What the node needs beside what mapping and planning do."""

    map: str = parameter(
        '', doc='Map to localise in, a YAML of map_server; empty: make one', read_only=True
    )
    save_map: str = parameter('map', doc='Name that ~/save_map writes to, .yaml and .pgm')
    map_frame: str = parameter('map', doc='Frame of the map', read_only=True)
    control_frequency: float = parameter(
        20.0,
        unit='Hz',
        doc='How often it commands a velocity, and tells where odom is in the map',
        above=0.0,
        maximum=100.0,
        read_only=True,
    )
    transform_tolerance: float = parameter(
        0.1, unit='s', doc='How far the transform from map to odom is post-dated', minimum=0.0
    )
    stamped: bool = parameter(
        False, doc='Publish cmd_vel as TwistStamped, not Twist', read_only=True
    )
    robot_radius: float = parameter(
        0.25, unit='m', doc='Radius of a round robot', above=0.0, read_only=True
    )
    footprint_length: float = parameter(
        0.0,
        unit='m',
        doc='Length of a robot that is no circle, its base frame in its middle; 0: round',
        minimum=0.0,
        read_only=True,
    )
    footprint_width: float = parameter(
        0.0,
        unit='m',
        doc='Its width; 0: round',
        minimum=0.0,
        read_only=True,
    )
    mapping: MappingParameters = group(MappingParameters)
    limits: DriveLimits = group(DriveLimits)
    planning: PlanningParameters = group(PlanningParameters)

    @property
    def footprint(self) -> Footprint:
        """What of the floor the robot covers."""
        half_length, half_width = 0.5 * self.footprint_length, 0.5 * self.footprint_width
        if half_length > 0.0 or half_width > 0.0:
            return Footprint(half_length=half_length, half_width=half_width)
        return Footprint(radius=self.robot_radius)
