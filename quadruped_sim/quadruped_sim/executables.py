# SPDX-License-Identifier: Apache-2.0
"""The leg controller as a program: --help and wrong words are answered before it loads."""

from wasd_core.command_line import Executable

leg_controller = Executable(
    name='leg_controller',
    module='quadruped_sim.leg_controller_node',
    about='Walks a quadruped: keys and cmd_vel in, joint_commands, odom and /tf out.',
    parameters=('quadruped_sim.parameters:LegNodeParameters',),
    example='leg_controller --ros-args -p description:=go2 -p use_sim_time:=true',
)
