# SPDX-License-Identifier: Apache-2.0
"""
How keys are called in messages, keymaps and key scripts.

A printable character is called by itself (`w`, `é`, and a blank for the space bar). Other keys
have names in capitals (`UP`, `F5`, `ESC`). Modifiers stand in front, in the order CTRL, ALT,
SHIFT: `CTRL+A`, `ALT+x`, `CTRL+SHIFT+UP`. Shift is not named where it only picks the character.
"""

import difflib

MODIFIERS = ('CTRL', 'ALT', 'SHIFT')
FUNCTION_KEYS = tuple(f'F{number}' for number in range(1, 13))
NAMED_KEYS = frozenset(
    ('UP', 'DOWN', 'LEFT', 'RIGHT', 'HOME', 'END', 'PGUP', 'PGDN', 'INSERT', 'DELETE')
    + ('ESC', 'ENTER', 'TAB', 'BACKSPACE')
    + FUNCTION_KEYS
)

# Names for characters that a file format cannot hold as themselves.
ALIASES = {'SPACE': ' '}


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
    modifiers, base = _split(text)
    if base in ALIASES:
        base = ALIASES[base]
    elif base not in NAMED_KEYS and not (len(base) == 1 and base.isprintable()):
        near = difflib.get_close_matches(base.upper(), (*NAMED_KEYS, *ALIASES), n=1)
        hint = f', did you mean {near[0]}?' if near else ''
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
