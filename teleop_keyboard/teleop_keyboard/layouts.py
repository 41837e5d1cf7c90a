# SPDX-License-Identifier: Apache-2.0
"""Keyboards on which the keys of a preset are at the same places under other letters."""

from collections.abc import Mapping

from teleop_keyboard.key_names import MODIFIERS

LAYOUTS = ('qwerty', 'azerty', 'dvorak')

# The same places, row by row, and again with Shift; digits and others are where qwerty has them.
_PLACES = {
    'qwerty': ("qwertyuiop[]asdfghjkl;'zxcvbnm,./-=", 'QWERTYUIOP{}ASDFGHJKL:"ZXCVBNM<>?_+'),
    # Without the keys of its digits' row, which Shift makes digits.
    'azerty': ('azertyuiop^$qsdfghjklmùwxcvbn,;:!)=', 'AZERTYUIOP¨£QSDFGHJKLM%WXCVBN?./§°+'),
    'dvorak': ("',.pyfgcrl/=aoeuidhtns-;qjkxbmwvz[]", '"<>PYFGCRL?+AOEUIDHTNS_:QJKXBMWVZ{}'),
}


def places(layout: str) -> Mapping[str, str]:
    """Return what the keys of qwerty are called on a layout, without and with Shift."""
    return dict(zip(''.join(_PLACES['qwerty']), ''.join(_PLACES[layout]), strict=True))


def on_layout(key: str, layout: str) -> str:
    """Return the name that a key of qwerty has on a layout; modifiers stay."""
    return _renamed(key, places(layout))


def on_qwerty(key: str, layout: str) -> str:
    """Return what the key that a layout calls `key` is called on qwerty; modifiers stay."""
    return _renamed(key, {name: place for place, name in places(layout).items()})


def _renamed(key: str, names: Mapping[str, str]) -> str:
    head, plus, base = key.rpartition('+')
    if plus and base and all(word in MODIFIERS for word in head.split('+')):
        return f'{head}+{names.get(base, base)}'
    return names.get(key, key)
