# SPDX-License-Identifier: Apache-2.0
"""A keymap as keys to click."""

from teleop_keyboard.keymap import direction_words
from teleop_keyboard.keymap import factor_words
from teleop_keyboard.keymap import Keymap
from wasd_cockpit.snapshot import KeyCap


def keymap_caps(keymap: Keymap) -> tuple[KeyCap, ...]:
    """Return the keys of a keymap and what each does."""
    return (
        *(KeyCap(key, direction_words(way), True) for key, way in keymap.motion.items()),
        *(KeyCap(key, 'stop at once') for key in sorted(keymap.stop_keys)),
        *(KeyCap(key, factor_words(way)) for key, way in keymap.speed_keys.items()),
    )
