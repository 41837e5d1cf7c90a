# SPDX-License-Identifier: Apache-2.0
"""The state publisher as a program: --help and wrong words are answered before it loads."""

from collections.abc import Sequence

from wasd_core.command_line import Executable

STATE_PUBLISHER = Executable(
    name='state_publisher',
    module='robot_description.state_publisher_node',
    about="Publishes robot_description, and from joint_states where the robot's links are: /tf.",
    parameters=('robot_description.node_parameters:StatePublisherParameters',),
    example='state_publisher --ros-args -p description:=mbot -p use_sim_time:=true',
)


def state_publisher(args: Sequence[str] | None = None) -> int:
    """Run `state_publisher`; return the exit status."""
    return STATE_PUBLISHER.run(args)
