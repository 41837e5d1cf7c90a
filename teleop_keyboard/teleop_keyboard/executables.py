# SPDX-License-Identifier: Apache-2.0
"""The programs of teleoperation: --help and wrong words are answered before it loads."""

from wasd_core.command_line import Executable

TWIST_NOTES = (
    '  stamped  (auto)',
    '    Publish TwistStamped: auto (what the subscriber takes), true or false',
)
key_publisher = Executable(
    name='key_publisher',
    module='teleop_keyboard.key_publisher_node',
    about='Publishes each key of the terminal, or of a pipe, on the topic keys.',
    parameters=('teleop_keyboard.parameters:KeyParameters',),
    example='key_publisher --save-keys drive.keys',
    takes_keys=True,
)
keys_to_twist = Executable(
    name='keys_to_twist',
    module='teleop_keyboard.keys_to_twist_node',
    about='Turns keys into velocities on cmd_vel, by a preset and its ramps.',
    parameters=('teleop_keyboard.parameters:TeleopParameters',),
    notes=TWIST_NOTES,
    example='keys_to_twist --ros-args -p preset:=wasd -p speed:=0.3',
)
teleop = Executable(
    name='teleop',
    module='teleop_keyboard.teleop_node',
    about='Drives with the keyboard: keys and cmd_vel of one terminal, and a dashboard.',
    parameters=('teleop_keyboard.parameters:TeleopParameters',),
    notes=(*TWIST_NOTES, '', 'keys: wasd keys, wasd keys NAME; `?` shows them while it runs'),
    example='teleop --ros-args -p preset:=wasd -r cmd_vel:=key_vel',
    takes_keys=True,
)
twist_mux = Executable(
    name='twist_mux',
    module='teleop_keyboard.twist_mux_node',
    about='Lets one of several velocity sources drive, by priority, time-out and locks.',
    parameters=('teleop_keyboard.parameters:MuxParameters',),
    notes=(
        '  topics.NAME.topic, .timeout [s], .priority; locks.NAME.topic, .timeout, .priority',
        '    The tables of sources and locks; see docs/parameters.md for those that are there',
    ),
    example='twist_mux --ros-args -r cmd_vel_out:=cmd_vel',
)
gamepad = Executable(
    name='gamepad',
    module='teleop_keyboard.gamepad_node',
    about='Publishes a gamepad as joy, and drives by it: cmd_vel and keys.',
    parameters=(
        'teleop_keyboard.parameters:PadParameters',
        'teleop_keyboard.parameters:JoyParameters',
    ),
    notes=TWIST_NOTES,
    example='gamepad --ros-args -p preset:=go2 -r cmd_vel:=joy_vel',
)
