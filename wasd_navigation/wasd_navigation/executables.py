# SPDX-License-Identifier: Apache-2.0
"""The navigator as a program: --help and wrong words are answered before it loads."""

from wasd_core.command_line import Executable

navigator = Executable(
    name='navigator',
    module='wasd_navigation.navigator_node',
    about='Maps or localises by scan and odom, drives to goal_pose by cmd_vel.',
    parameters=('wasd_navigation.parameters:NavigatorParameters',),
    example='navigator --ros-args -p use_sim_time:=true -r cmd_vel:=nav_vel',
)
