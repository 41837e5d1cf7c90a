# SPDX-License-Identifier: Apache-2.0
"""Parameters of the guard; names of Nav2's collision monitor where it has one."""

from dataclasses import dataclass

from wasd_core.command_line import Executable
from wasd_core.parameters import group, parameter, Parameters

from wasd_navigation.parameters import SizeParameters

guard = Executable(
    name='guard',
    module='wasd_navigation.guard_node',
    about='Lets no velocity drive a robot into what its lidar sees; between mux and controller.',
    parameters=('wasd_navigation.guard_parameters:GuardNodeParameters',),
    example='guard --ros-args -p use_sim_time:=true -p cmd_vel_in_topic:=cmd_vel_smoothed',
)


@dataclass(frozen=True, kw_only=True)
class GuardParameters(Parameters):
    """When a command is limited, and by how much."""

    enabled: bool = parameter(
        True, name='FootprintApproach.enabled', doc='Whether commands are limited at all'
    )
    action_type: str = parameter(
        'approach',
        name='FootprintApproach.action_type',
        choices=('approach', 'slowdown', 'stop'),
        doc='What is done to a command that would collide within time_before_collision',
    )
    time_before_collision: float = parameter(
        1.0,
        name='FootprintApproach.time_before_collision',
        unit='s',
        minimum=0.1,
        maximum=10.0,
        doc='A collision that is nearer in time slows the robot down',
    )
    slowdown_ratio: float = parameter(
        0.5,
        name='FootprintApproach.slowdown_ratio',
        minimum=0.0,
        maximum=1.0,
        doc='Share of a command that is followed where the action is slowdown',
    )
    footprint_padding: float = parameter(
        0.03,
        unit='m',
        minimum=0.0,
        maximum=1.0,
        doc='Room that is kept around the footprint',
    )
    reaction_time: float = parameter(
        0.15,
        unit='s',
        minimum=0.0,
        maximum=2.0,
        doc='For so long a command is followed before the next one can brake',
    )
    source_timeout: float = parameter(
        0.5,
        unit='s',
        minimum=0.05,
        maximum=10.0,
        doc='A scan that is older stops the robot',
    )


@dataclass(frozen=True, kw_only=True)
class BrakingParameters(Parameters):
    """What decelerations the robot is sure to manage."""

    forward: float = parameter(
        1.0, unit='m/s^2', minimum=0.05, maximum=100.0, doc='Slowing down ahead and backward'
    )
    lateral: float = parameter(
        1.0, unit='m/s^2', minimum=0.05, maximum=100.0, doc='Slowing down sideways'
    )
    yaw: float = parameter(
        3.0, unit='rad/s^2', minimum=0.05, maximum=100.0, doc='Slowing down a turn'
    )


@dataclass(frozen=True, kw_only=True)
class GuardNodeParameters(SizeParameters, GuardParameters):
    """What the node needs beside that."""

    cmd_vel_in_topic: str = parameter(
        'cmd_vel_smoothed', doc='Where commands come from', read_only=True
    )
    cmd_vel_out_topic: str = parameter('cmd_vel', doc='Where limited commands go', read_only=True)
    enable_stamped_cmd_vel: bool = parameter(
        False, doc='Commands are TwistStamped, not Twist', read_only=True
    )
    scan_topic: str = parameter(
        'scan', name='scan.topic', doc='Where scans come from', read_only=True
    )
    braking: BrakingParameters = group(BrakingParameters)
