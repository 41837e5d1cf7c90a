# SPDX-License-Identifier: Apache-2.0
"""Parameters of the policy player, and the program."""

from wasd_core.command_line import Executable
from wasd_core.parameters import fixed, Parameters


class PolicyNodeParameters(Parameters):
    """Which robot, and by which network it walks."""

    description: str = fixed('g1', doc='Robot: a built-in name, or a xacro or URDF file')
    policy: str = fixed(
        '', doc="Network that walks: an ONNX or TorchScript file; '' is none, and a G1 only stands"
    )
    policy_config: str = fixed(
        '', doc='File or preset with the training settings, if the network has none'
    )


policy_player = Executable(
    name='policy_player',
    module='policy_player.policy_player_node',
    node='PolicyPlayerNode',
    about='Walks a robot by a network: keys and cmd_vel in, joint_commands and state out.',
    parameters=('policy_player.parameters:PolicyNodeParameters',),
    example='policy_player --ros-args -p description:=g1 -p policy:=walk.onnx',
)
