# SPDX-License-Identifier: Apache-2.0
"""Keyboard and gamepad teleoperation: keys, keys to twist, presets, mux."""

from wasd_core import load_lazily, quiet_start

quiet_start(__name__, 'gamepad', 'key_publisher', 'keys_to_twist', 'teleop', 'twist_mux')

# Where each name is defined; ROS is loaded with those that need it.
_HOMES = {
    'Gamepad': 'gamepad_device',
    'GamepadNode': 'gamepad_node',
    'JoyToTwist': 'gamepad',
    'KeyPublisherNode': 'key_publisher_node',
    'KeyReader': 'key_reader',
    'Keymap': 'keymap',
    'KeysToTwist': 'keys_to_twist',
    'KeysToTwistNode': 'keys_to_twist_node',
    'Mux': 'mux',
    'TeleopParameters': 'parameters',
    'Terminal': 'terminal',
    'TwistMuxNode': 'twist_mux_node',
    'load_preset': 'keymap_file',
    'parse_key_script': 'key_script',
    'preset_names': 'keymap_file',
}
__all__ = list(_HOMES)  # noqa: PLE0605
__getattr__ = load_lazily(__name__, _HOMES)
