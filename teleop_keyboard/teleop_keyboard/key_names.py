# SPDX-License-Identifier: Apache-2.0
"""
How keys are called in messages, keymaps and key scripts, and on keyboards of other layouts.

A printable character is called by itself (`w`, `é`, and a blank for the space bar). Other keys
have names in capitals (`UP`, `F5`, `ESC`). Modifiers stand in front, in the order CTRL, ALT,
SHIFT: `CTRL+A`, `ALT+x`, `CTRL+SHIFT+UP`. Shift is not named where it only picks the character.

A name stands for a press; what else is told of keys is in `wasd_core.key_events`.
"""

from collections.abc import Mapping
import signal

from wasd_core.errors import did_you_mean
from wasd_core.key_events import ALIASES
from wasd_core.key_events import split_event
from wasd_core.key_events import with_event

MODIFIERS = ('CTRL', 'ALT', 'SHIFT')
# No keyboard sends it: a program does, when whoever drove is gone. It stops with every keymap.
STOP_KEY = 'STOP'
FUNCTION_KEYS = tuple(f'F{number}' for number in range(1, 13))
NAMED_KEYS = frozenset(
    ('UP', 'DOWN', 'LEFT', 'RIGHT', 'HOME', 'END', 'PGUP', 'PGDN', 'INSERT', 'DELETE')
    + ('ESC', 'ENTER', 'TAB', 'BACKSPACE', STOP_KEY)
    + FUNCTION_KEYS
)

# Keys that a terminal makes a signal of; from one that reports them as sequences, we do.
SIGNAL_KEYS = {
    'CTRL+C': signal.SIGINT,
    'CTRL+Z': signal.SIGTSTP,
    'CTRL+\\': signal.SIGQUIT,
}


def with_modifiers(key: str, *, ctrl: bool = False, alt: bool = False, shift: bool = False) -> str:
    """Return the name of a key pressed together with modifiers; blanks become `SPACE`."""
    if not (ctrl or alt or shift):
        return key
    base = 'SPACE' if key == ' ' else key
    if ctrl and len(base) == 1:
        # Terminals cannot tell Ctrl+a from Ctrl+A: one name for both.
        base = base.upper()
    pressed = zip(MODIFIERS, (ctrl, alt, shift), strict=True)
    return '+'.join([name for name, is_down in pressed if is_down] + [base])


def canonical_key(text: str) -> str:
    """
    Return the key that a name in a file means, as it stands in messages.

    Raises:
        ValueError: when `text` is neither one printable character nor the name of a key.
    """
    event, rest = split_event(text)
    if event:
        return with_event(event, canonical_key(rest))
    modifiers, base = _split(text)
    if base in ALIASES:
        base = ALIASES[base]
    elif base not in NAMED_KEYS and not (len(base) == 1 and base.isprintable()):
        hint = did_you_mean(base.upper(), (*NAMED_KEYS, *ALIASES))
        raise ValueError(f'unknown key {text!r}{hint} (a key is one character or a name like UP)')
    return with_modifiers(base, **{name.lower(): True for name in modifiers})


def _split(text: str) -> tuple[list[str], str]:
    """Return the modifiers in front of a key, and the key."""
    modifiers = []
    while len(text) > 1 and '+' in text[1:]:
        head, rest = text.split('+', 1)
        if head not in MODIFIERS or head in modifiers or not rest:
            break
        modifiers.append(head)
        text = rest
    return modifiers, text


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
