# SPDX-License-Identifier: Apache-2.0
"""Keyboard and gamepad teleoperation: keys, keys to twist, presets, mux."""

from wasd_core import quiet_start

quiet_start(__name__, 'gamepad', 'key_publisher', 'keys_to_twist', 'teleop', 'twist_mux')
