# SPDX-License-Identifier: Apache-2.0
"""Text of others on a terminal: what would steer the terminal is shown instead of done."""

import unicodedata

# Control characters, formats (bidi overrides, invisible marks), halves of pairs, breaks of lines.
UNSEEN = frozenset(('Cc', 'Cf', 'Cs', 'Zl', 'Zp'))
# Joiners belong to words of many scripts and to emojis; they steer nothing.
JOINERS = '\u200c\u200d'


def visible(text: str) -> str:
    r"""
    Return a text in which no character acts on a terminal: ESC as `^[`, U+009B as `\x9b`.

    Blanks are the only space left: a line break becomes `^J`, so one line stays one line.
    """
    if text.isascii() and text.isprintable():
        return text
    return ''.join(map(_visible, text))


def visible_lines(text: str) -> str:
    """Return the same of a text of several lines: its line breaks and tabs stay."""
    if text.isascii() and text.isprintable():
        return text
    return ''.join(one if one in '\n\t' else _visible(one) for one in text)


def _visible(one: str) -> str:
    code = ord(one)
    if code < 0x20 or code == 0x7F:
        return '^' + chr(code ^ 0x40)
    if one in JOINERS or unicodedata.category(one) not in UNSEEN:
        return one
    return one.encode('unicode_escape').decode('ascii')
