# SPDX-License-Identifier: Apache-2.0
"""Keyboards on which the keys of a preset are at the same places under other letters."""

from collections.abc import Mapping

from teleop_keyboard.key_names import MODIFIERS

LAYOUTS = ('qwerty', 'azerty', 'dvorak')

# The same places, row by row; digits and other keys are where they are on qwerty.
_PLACES = {
    'qwerty': "qwertyuiop[]asdfghjkl;'zxcvbnm,./-=",
    # Without the keys of its digits' row, which Shift makes digits.
    'azerty': 'azertyuiop^$qsdfghjklmùwxcvbn,;:!)=',
    'dvorak': "',.pyfgcrl/=aoeuidhtns-;qjkxbmwvz[]",
}


def places(layout: str) -> Mapping[str, str]:
    """Return what the keys of qwerty are called on a layout, capitals included."""
    pairs = dict(zip(_PLACES['qwerty'], _PLACES[layout], strict=True))
    capitals = {
        key.upper(): name.upper()
        for key, name in pairs.items()
        if key.isalpha() and name.isalpha()
    }
    return {**pairs, **capitals}


def on_layout(key: str, layout: str) -> str:
    """Return the name that a key of qwerty has on a layout; modifiers stay."""
    head, plus, base = key.rpartition('+')
    if plus and base and all(word in MODIFIERS for word in head.split('+')):
        return f'{head}+{places(layout).get(base, base)}'
    return places(layout).get(key, key)
