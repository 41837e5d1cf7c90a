# SPDX-License-Identifier: Apache-2.0
import unicodedata

from cases import for_all
import pytest
from wasd_core.streams import visible


@for_all(
    ('text', 'shown'),
    [
        ('trotting', 'trotting'),
        ('\x1b]0;owned\x07', '^[]0;owned^G'),
        ('\x9b31m', r'\x9b31m'),
        ('\x7f\x00\n\t', '^?^@^J^I'),
        ('abc\u202edcba', r'abc\u202edcba'),
        ('a\u2066b\u2069', r'a\u2066b\u2069'),
        ('a\u2028b', r'a\u2028b'),
        ('file\udcff', r'file\udcff'),
        ('\U000e0041', r'\U000e0041'),
        ('Grüße 中 🙂', 'Grüße 中 🙂'),
        ('👩\u200d🚀', '👩\u200d🚀'),
    ],
)
def test_what_would_steer_a_terminal_is_shown(text, shown):
    assert visible(text) == shown


def test_lines_stay_lines():
    assert visible('a: 1\n\tb: \x1b[2J\r\n', '\n\t') == 'a: 1\n\tb: ^[[2J^M\n'


@pytest.mark.slow
def test_no_character_of_unicode_that_controls_gets_through():
    characters = map(chr, range(0x110000))
    acting = [c for c in characters if unicodedata.category(c) in ('Cc', 'Cf', 'Cs', 'Zl', 'Zp')]
    assert len(acting) > 2000
    kinds = {unicodedata.category(c) for c in visible(''.join(acting)) if c not in '\u200c\u200d'}
    assert not kinds & {'Cc', 'Cf', 'Cs', 'Zl', 'Zp'}
