# SPDX-License-Identifier: Apache-2.0
"""Parameters of the guard; names of Nav2's collision monitor where it has one."""

from wasd_core.command_line import Executable
from wasd_core.parameters import fixed, group, parameter, Parameters

from wasd_navigation.parameters import SizeParameters

guard = Executable(
    name='guard',
    module='wasd_navigation.guard_node',
    node='GuardNode',
    joins=True,
    about='Slows and stops a robot before obstacles of its lidar; between mux and controller.',
    parameters=('wasd_navigation.guard_parameters:GuardNodeParameters',),
    example='guard --ros-args -p use_sim_time:=true -p cmd_vel_in_topic:=cmd_vel_smoothed',
)


class GuardParameters(Parameters):
    """When a command is limited, and by how much."""

    enabled: bool = parameter(True, name='FootprintApproach.enabled', doc='Limit commands')
    action_type: str = parameter(
        'approach',
        name='FootprintApproach.action_type',
        choices=('approach', 'slowdown', 'stop'),
        doc='Action on a command that would collide within time_before_collision',
    )
    time_before_collision: float = parameter(
        1.0,
        name='FootprintApproach.time_before_collision',
        unit='s',
        minimum=0.1,
        maximum=10.0,
        doc='Slows the robot down if a collision is nearer in time',
    )
    slowdown_ratio: float = parameter(
        0.5,
        name='FootprintApproach.slowdown_ratio',
        minimum=0.0,
        maximum=1.0,
        doc='Share of a command that the action slowdown follows',
    )
    footprint_padding: float = parameter(
        0.03,
        unit='m',
        minimum=0.0,
        maximum=1.0,
        doc='Clearance around the footprint',
    )
    drift: float = parameter(
        0.02,
        unit='m/m',
        minimum=0.0,
        maximum=1.0,
        doc='Growth of the clearance with the way ahead, beyond half of footprint_padding',
    )
    reaction_time: float = parameter(
        0.15,
        unit='s',
        minimum=0.0,
        maximum=2.0,
        doc='Delay before the next command can brake',
    )
    source_timeout: float = parameter(
        0.5,
        unit='s',
        minimum=0.05,
        maximum=10.0,
        doc='Age of the scan or odometry above which the robot stops',
    )


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


class GuardNodeParameters(SizeParameters, GuardParameters):
    """What the node needs beside that."""

    cmd_vel_in_topic: str = fixed('cmd_vel_smoothed', doc='Topic of incoming commands')
    cmd_vel_out_topic: str = fixed('cmd_vel', doc='Topic of limited commands')
    enable_stamped_cmd_vel: bool = fixed(False, doc='Commands are TwistStamped, not Twist')
    scan_topic: str = fixed('scan', name='scan.topic', doc='Topic of scans')
    braking: BrakingParameters = group(BrakingParameters)
