# SPDX-License-Identifier: Apache-2.0
"""The leg controller as a program: --help and wrong words are answered before it loads."""

from collections.abc import Sequence

from wasd_core.command_line import Executable

LEG_CONTROLLER = Executable(
    name='leg_controller',
    module='quadruped_sim.leg_controller_node',
    about='Walks a quadruped: keys and cmd_vel in, joint_commands, odom and /tf out.',
    parameters=('quadruped_sim.parameters:LegNodeParameters',),
    example='leg_controller --ros-args -p description:=go2 -p use_sim_time:=true',
)


def leg_controller(args: Sequence[str] | None = None) -> int:
    """Run `leg_controller`; return the exit status."""
    return LEG_CONTROLLER.run(args)
