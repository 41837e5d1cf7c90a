# SPDX-License-Identifier: Apache-2.0
"""The drive controller as a program: --help and wrong words are answered before it loads."""

from wasd_core.command_line import Executable

diff_drive_controller = Executable(
    name='diff_drive_controller',
    module='diff_drive_sim.diff_drive_controller_node',
    about='Drives a robot of two wheels: cmd_vel in, wheel commands, odom and /tf out.',
    parameters=('diff_drive_sim.parameters:DiffDriveParameters',),
    example='diff_drive_controller --ros-args -p description:=mbot -p use_sim_time:=true',
)
