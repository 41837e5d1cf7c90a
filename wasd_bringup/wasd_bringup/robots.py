# SPDX-License-Identifier: Apache-2.0
"""The Go2's own keyboard, unitree_guide's: states and sticks, on any layout."""

from quadruped_sim.keys import STICK_KEYS
from teleop_keyboard.key_names import on_layout

UNITREE_PRESET = 'unitree'
HELP = (
    '2 stand   4 trot   5 move base (cmd_vel)   1 passive',
    '3 free stand   0 balance test   9 swing test   8 step test',
    '{w}/{s} forward, backward   {a}/{d} left, right   {j}/{l} turn   {i}/{k} height'
    '   space: centre',
    'First 2, then 4, then {w}.',
)
FIRST_KEYS = 'press 2 to stand, 4 to trot; then {w} {s} {a} {d} walk, {j} {l} turn, space stops'


def unitree_help(layout: str) -> tuple[str, ...]:
    """Return the keys in words; the first two lines are those of the states."""
    return tuple(line.format_map(_names(layout)) for line in HELP)


def unitree_first_keys(layout: str) -> str:
    """Return the keys to press first."""
    return FIRST_KEYS.format_map(_names(layout))


def _names(layout: str) -> dict[str, str]:
    return {key: on_layout(key, layout) for key in STICK_KEYS}
