# SPDX-License-Identifier: Apache-2.0
import io

import pytest
from teleop_keyboard.keymap import load_preset
from teleop_keyboard.keys_to_twist import KeysToTwist
from teleop_keyboard.status_line import describe
from teleop_keyboard.status_line import StatusLine


class Screen(io.StringIO):
    def isatty(self):
        return True


def test_the_line_is_rewritten_in_place_and_only_when_it_changed():
    screen = Screen()
    line = StatusLine(screen)
    for now, text in enumerate(['one', 'one', 'two']):
        line.show(text, float(now))
    line.close()
    assert screen.getvalue() == '\rone\x1b[K\rtwo\x1b[K\n'


def test_the_line_is_not_rewritten_faster_than_one_can_read():
    screen = Screen()
    line = StatusLine(screen)
    for index in range(100):
        line.show(str(index), index * 0.01)
    assert screen.getvalue().count('\r') <= 11


def test_a_wide_text_stays_one_line(monkeypatch):
    monkeypatch.setenv('COLUMNS', '20')
    screen = Screen()
    StatusLine(screen).show('x' * 100, 0.0)
    assert screen.getvalue().count('x') == 19


def test_nothing_is_written_where_no_terminal_is():
    stream = io.StringIO()
    line = StatusLine(stream)
    line.show('one', 0.0)
    line.close()
    assert stream.getvalue() == ''


@pytest.mark.parametrize('key', ['i', ' ', 'q', 'UP', 'CTRL+ALT+SHIFT+DOWN'])
def test_the_status_has_one_width_and_fits_an_80_column_window(key):
    logic = KeysToTwist(load_preset('mbot'))
    empty = describe(logic)
    logic.press(key)
    logic.step(0.1)
    assert len(describe(logic)) == len(empty)
    assert len(empty) < 80
