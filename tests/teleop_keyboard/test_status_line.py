# SPDX-License-Identifier: Apache-2.0
import io
import re

import pytest
from teleop_keyboard.dashboard import Line
from teleop_keyboard.screen import StatusLine, styled


class Screen(io.StringIO):
    def isatty(self):
        return True


def placed(text):
    """Return how a text is drawn: an empty line, the text, the cursor back on the first."""
    return f'\r\x1b[K\r\n{text}\x1b[J\r\x1b[1A'


@pytest.fixture(autouse=True)
def window(monkeypatch):
    monkeypatch.setenv('COLUMNS', '80')
    monkeypatch.setenv('LINES', '24')


def test_the_line_is_rewritten_in_place_and_only_when_it_changed():
    screen = Screen()
    line = StatusLine(screen)
    for now, text in enumerate(['one', 'one', 'two']):
        line.show(lambda _, text=text: text, float(now))
    line.close()
    assert screen.getvalue() == placed('one') + placed('two') + '\x1b[1B\r\n'


def test_in_a_window_of_two_lines_it_is_the_line_at_the_cursor(monkeypatch):
    monkeypatch.setenv('LINES', '2')
    screen = Screen()
    line = StatusLine(screen)
    line.show(lambda _: 'one', 0.0)
    line.show(lambda _: 'two', 1.0)
    line.close()
    assert screen.getvalue() == '\rone\x1b[K\rtwo\x1b[K\n'


def test_a_window_that_shrinks_loses_nothing(monkeypatch):
    screen = Screen()
    line = StatusLine(screen)
    line.show(lambda _: 'one', 0.0)
    monkeypatch.setenv('LINES', '2')
    line.show(lambda _: 'two', 1.0)
    assert screen.getvalue() == placed('one') + '\r\x1b[J\rtwo\x1b[K'


def test_no_color_leaves_out_colours_and_keeps_what_is_bright_or_dim(monkeypatch):
    lines = [Line(style, style) for style in ('target', 'actual', 'warning', 'title', 'dim')]
    monkeypatch.delenv('NO_COLOR', raising=False)
    coloured = [styled(line, in_ascii=False) for line in lines]
    assert all(text.startswith('\x1b[') for text in coloured)
    monkeypatch.setenv('NO_COLOR', '1')
    plain = [styled(line, in_ascii=False) for line in lines]
    assert plain == ['target', 'actual', 'warning', *coloured[3:]]
    monkeypatch.setenv('NO_COLOR', '')  # empty is not set
    assert [styled(line, in_ascii=False) for line in lines] == coloured


def test_the_line_is_not_rewritten_faster_than_one_can_read():
    screen = Screen()
    line = StatusLine(screen)
    for index in range(100):
        line.show(lambda _, index=index: str(index), index * 0.01)
    assert screen.getvalue().count('\x1b[K') <= 11


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


def test_what_is_new_is_told_in_plain_lines_where_nothing_can_be_drawn():
    stream = io.StringIO()
    line = StatusLine(stream)
    for now, text in enumerate(('one', 'one', '', 'two\x1b[2J', 'one')):
        line.show(lambda _: 'never', float(now), plain=lambda text=text: text)
        line.show(lambda _: 'never', now + 0.01, plain=lambda: 'too soon')
    line.close()
    first, second, third = stream.getvalue().splitlines()
    assert (first, third) == ('one', 'one')
    assert second.startswith('two')
    assert '\x1b' not in second


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
    assert screen.getvalue() == placed('status') + '\r\x1b[Jone\ntwo\n' + placed('status')


def test_lines_that_are_wider_than_the_window_are_broken_between_words(monkeypatch):
    monkeypatch.setenv('COLUMNS', '20')
    screen = Screen()
    StatusLine(screen).print(['2 stand   4 trot   5 move', '', 'http://127.0.0.1:8080/index'])
    assert screen.getvalue() == '2 stand   4 trot   5\nmove\n\nhttp://127.0.0.1:8080/index\n'


def test_lines_are_written_plainly_where_no_terminal_is():
    stream = io.StringIO()
    StatusLine(stream).print(['one'])
    assert stream.getvalue() == 'one\n'


def board(width, height):
    """Return two lines, as wide as they may be."""
    return [Line('-' * width, 'dim'), Line('second')]


def test_a_board_stands_above_the_line_and_the_cursor_above_both(monkeypatch):
    monkeypatch.setenv('COLUMNS', '10')
    screen = Screen()
    line = StatusLine(screen)
    line.show(lambda _: 'status', 0.0, board)
    frame = '\r\x1b[K\r\n\x1b[2m---------\x1b[0m\x1b[K\r\nsecond\x1b[K\r\nstatus\x1b[J\r\x1b[3A'
    assert screen.getvalue() == frame
    line.print(['one'])
    line.show(lambda _: 'status', 0.01, board)
    assert screen.getvalue() == f'{frame}\r\x1b[Jone\n{frame}'
    # The shell's prompt comes below all of it.
    line.close()
    assert screen.getvalue().endswith('\x1b[3B\r\n')


def test_what_others_write_stays_above_the_board(monkeypatch):
    """As on a terminal of 8 lines: a log's line goes where the cursor waits."""
    monkeypatch.setenv('COLUMNS', '40')
    screen = Screen()
    line = StatusLine(screen)
    for now in range(3):
        line.show(lambda _, now=now: f'status {now}', float(now), board)
        screen.write(f'log {now}\r\n')
    line.close()
    shown = [text.rstrip() for text in as_shown(screen.getvalue(), 8)]
    # The board of the last frame lies below what was written after it.
    assert [text for text in shown if text.startswith('log')] == ['log 0', 'log 1', 'log 2']
    line.show(lambda _: 'status 3', 9.0, board)
    shown = [text.rstrip() for text in as_shown(screen.getvalue(), 12)]
    assert 'status 3' in shown
    assert shown[shown.index('status 3') - 1] == 'second'


def as_shown(text: str, height: int) -> list[str]:
    """Return the lines of a window that understands what is written here, and no more."""
    lines, row, column = [''], 0, 0
    for part in re.findall(r'\x1b\[\d*[A-Za-z]|[\r\n]|[^\x1b\r\n]+', text):
        if part == '\r':
            column = 0
        elif part == '\n':
            row, column = row + 1, 0
        elif part.startswith('\x1b['):
            count = int(part[2:-1] or 1)
            if part[-1] == 'A':
                row = max(row - count, 0)
            elif part[-1] == 'B':
                row = min(row + count, len(lines) - 1)
            elif part[-1] in 'JK':
                lines[row] = lines[row][:column]
                if part[-1] == 'J':
                    del lines[row + 1 :]
        else:
            lines[row] = lines[row].ljust(column)
            lines[row] = lines[row][:column] + part + lines[row][column + len(part) :]
            column += len(part)
        lines += [''] * (row + 1 - len(lines))
    return lines[-height:]
