# SPDX-License-Identifier: Apache-2.0
"""The navigator as a program: --help and wrong words are answered before it loads."""

from collections.abc import Sequence

from wasd_core.command_line import Executable

NAVIGATOR = Executable(
    name='navigator',
    module='wasd_navigation.navigator_node',
    about='Maps or localises by scan and odom, drives to goal_pose by cmd_vel.',
    parameters=('wasd_navigation.parameters:NavigatorParameters',),
    example='navigator --ros-args -p use_sim_time:=true -r cmd_vel:=nav_vel',
)


def navigator(args: Sequence[str] | None = None) -> int:
    """Run `navigator`; return the exit status."""
    return NAVIGATOR.run(args)
