# SPDX-License-Identifier: Apache-2.0
"""Keyboard and gamepad teleoperation: keys, keys to twist, presets, mux."""

from wasd_core import load_lazily, quiet_start

quiet_start(__name__, 'gamepad', 'key_publisher', 'keys_to_twist', 'teleop', 'twist_mux')

# Public names by module; ROS is loaded with those that need it.
__all__, __getattr__ = load_lazily(
    __name__,
    {
        'gamepad': 'JoyToTwist',
        'gamepad_device': 'Gamepad',
        'gamepad_node': 'GamepadNode',
        'key_publisher_node': 'KeyPublisherNode',
        'key_reader': 'KeyReader',
        'key_script': 'parse_key_script',
        'keymap': 'Keymap',
        'keymap_file': 'load_preset preset_names',
        'keys_to_twist': 'KeysToTwist',
        'keys_to_twist_node': 'KeysToTwistNode',
        'mux': 'Mux',
        'parameters': 'TeleopParameters',
        'terminal': 'Terminal',
        'twist_mux_node': 'TwistMuxNode',
    },
)
