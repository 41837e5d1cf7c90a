# SPDX-License-Identifier: Apache-2.0
import io

from teleop_keyboard.screen import StatusLine


class Screen(io.StringIO):
    def isatty(self):
        return True


def test_the_line_is_rewritten_in_place_and_only_when_it_changed():
    screen = Screen()
    line = StatusLine(screen)
    for now, text in enumerate(['one', 'one', 'two']):
        line.show(lambda _, text=text: text, float(now))
    line.close()
    assert screen.getvalue() == '\rone\x1b[K\rtwo\x1b[K\n'


def test_the_line_is_not_rewritten_faster_than_one_can_read():
    screen = Screen()
    line = StatusLine(screen)
    for index in range(100):
        line.show(lambda _, index=index: str(index), index * 0.01)
    assert screen.getvalue().count('\r') <= 11


def test_a_wide_text_stays_one_line(monkeypatch):
    monkeypatch.setenv('COLUMNS', '20')
    screen = Screen()
    StatusLine(screen).show(lambda _: 'x' * 100, 0.0)
    assert screen.getvalue().count('x') == 19


def test_nothing_is_written_where_no_terminal_is():
    stream = io.StringIO()
    line = StatusLine(stream)
    line.show(lambda _: 'one', 0.0)
    line.close()
    assert stream.getvalue() == ''


def test_the_text_is_made_for_the_window(monkeypatch):
    monkeypatch.setenv('COLUMNS', '20')
    screen = Screen()
    StatusLine(screen).show(lambda width: f'{width} columns', 0.0)
    assert '19 columns' in screen.getvalue()


def test_lines_are_written_above_and_the_status_comes_again_below():
    screen = Screen()
    line = StatusLine(screen)
    line.show(lambda _: 'status', 0.0)
    line.print(['one', 'two'])
    line.show(lambda _: 'status', 0.01)
    assert screen.getvalue() == '\rstatus\x1b[K\r\x1b[Kone\ntwo\n\rstatus\x1b[K'


def test_lines_are_written_plainly_where_no_terminal_is():
    stream = io.StringIO()
    StatusLine(stream).print(['one'])
    assert stream.getvalue() == 'one\n'
