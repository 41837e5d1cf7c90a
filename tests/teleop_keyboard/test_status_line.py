# SPDX-License-Identifier: Apache-2.0
import io

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
