# SPDX-License-Identifier: Apache-2.0
"""The Go2's own keyboard, unitree_guide's: states and sticks, on any layout."""

from quadruped_sim.sticks import STICK_KEYS
from teleop_keyboard.layouts import on_layout

UNITREE_PRESET = 'unitree'
HELP = (
    '2 stand   4 trot   5 move base (cmd_vel)   1 passive',
    '3 free stand   0 balance test   9 swing test   8 step test',
    '{w}/{s} forward, backward   {a}/{d} left, right   {j}/{l} turn   {i}/{k} height'
    '   space: centre',
    'Ctrl-C quits. First 2, then 4, then {w}.',
)


def unitree_help(layout: str) -> tuple[str, ...]:
    """Return the keys in words; the first two lines are those of the states."""
    names = {key: on_layout(key, layout) for key in STICK_KEYS}
    return tuple(line.format_map(names) for line in HELP)
