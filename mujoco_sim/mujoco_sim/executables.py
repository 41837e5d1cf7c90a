# SPDX-License-Identifier: Apache-2.0
"""The simulator as a program: --help and wrong words are answered before it loads."""

from wasd_core.command_line import Executable

simulator = Executable(
    name='simulator',
    module='mujoco_sim.simulator_node',
    about='Simulates a robot in MuJoCo: joint_commands in, joint_states, imu/data and /clock out.',
    parameters=('mujoco_sim.parameters:SimulatorParameters',),
    example='simulator --ros-args -p description:=go2 -p world:=stairs:0.1',
)
