# SPDX-License-Identifier: Apache-2.0
"""What is rewritten in place on a terminal: a page or a line. Nothing here waits for it."""

from collections.abc import Callable, Sequence
import math
import os
import shutil
import textwrap
from typing import TextIO

from wasd_core.streams import offer, PATIENCE, visible

from teleop_keyboard.dashboard import ASCII, FULL, Line
from teleop_keyboard.terminal import may_draw_on, understands_escapes

# A page is rewritten at most this often: fluent, and cheap over a slow connection [s].
FRAME_PERIOD = 0.05
# Lines of a log come at most this often [s].
LOG_PERIOD = 0.5

STYLES = {
    'title': '\x1b[7;1m',
    'target': '\x1b[36m',
    'actual': '\x1b[32m',
    'warning': '\x1b[33m',
    'dim': '\x1b[2m',
}
COLOURED = ('target', 'actual', 'warning')
NORMAL = '\x1b[0m'
# The alternate screen, without a cursor; and the user's own again, as it was.
OPEN = '\x1b[?1049h\x1b[?25l'
CLOSE = '\x1b[?25h\x1b[?1049l'
# Terminals that know it show what is between these at once.
BEGIN = '\x1b[?2026h\x1b[H'
END = '\x1b[J\x1b[?2026l'


class Screen:
    """
    Shows a page in place.

    A frame is one write, from the top left, each line cleared behind its end: nothing blinks, and
    nothing is left over when the window changes its size. `pause` gives the terminal back, e.g.
    while the process is suspended; the next `show` takes it again. Control characters in a line
    are shown, not done. While the terminal takes nothing, frames are dropped.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.is_terminal = understands_escapes(stream)  # else no page is shown, only lines
        self._is_open = False
        self._shown: tuple[object, ...] = ()
        self._shown_at = -LOG_PERIOD
        self._in_ascii = not _encodes(stream, FULL)

    def show(self, page: Callable[[int, int], Sequence[Line]], now: float) -> None:
        """Show the page for the window as it is, unless the last is too young; `now` in [s]."""
        if not self.is_terminal or now - self._shown_at < FRAME_PERIOD:
            return
        self._shown_at = now
        if not may_draw_on(self._stream):
            return
        size = shutil.get_terminal_size()
        lines = page(size.columns, size.lines)
        if self._is_open and self._shown == (size, *lines):
            return
        text = '\r\n'.join(styled(line, self._in_ascii) + '\x1b[K' for line in lines)
        # A terminal that has no room for a frame gets the next one that it has room for.
        if offer(self._stream, ('' if self._is_open else OPEN) + BEGIN + text + END):
            self._shown = (size, *lines)
            self._is_open = True

    def log(self, text: str, now: float) -> None:
        """Write a new line where the output is no terminal, unless the last is too young."""
        if self.is_terminal or now - self._shown_at < LOG_PERIOD or self._shown == (text,):
            return
        self._shown, self._shown_at = (text,), now
        offer(self._stream, visible(text) + '\n')

    def close(self) -> None:
        """Give the terminal back as it was; the next page takes it again."""
        if self._is_open:
            self._is_open = False
            offer(self._stream, CLOSE, PATIENCE)


def styled(line: Line, in_ascii: bool) -> str:
    """Return a line as it is written; control characters in it are shown, not done."""
    words = visible(line.text)
    text = words.translate(ASCII) if in_ascii else words
    is_plain = line.style in COLOURED and os.environ.get('NO_COLOR')  # as no-color.org has it
    style = '' if is_plain else STYLES.get(line.style, '')
    return f'{style}{text}{NORMAL}' if style else text


def folded(lines: Sequence[str], stream: TextIO) -> str:
    """Return lines in one text; a terminal would break those that are too long inside words."""
    if stream.isatty():
        fold = textwrap.TextWrapper(
            shutil.get_terminal_size().columns, break_long_words=False, break_on_hyphens=False
        )
        lines = ['\n'.join(fold.wrap(line)) for line in lines]
    return '\n'.join(lines)


def _encodes(stream: TextIO, text: str) -> bool:
    try:
        text.encode(stream.encoding or 'utf-8')
    except (UnicodeEncodeError, LookupError):
        return False
    return True


# In a window of fewer lines no empty one is left above the status.
_ROOM = 3
# The line is rewritten at most this often: readable, and cheap over a slow connection [s].
LINE_PERIOD = 0.1


class StatusLine:
    """
    A line at the cursor that always shows the last text; where nothing can be rewritten, as on a
    dumb terminal or in a pipe, a plain line for each that is new of what seldom changes.

    It is written in one piece and only when it changed, so it does not flicker; a text that is
    wider than the window is cut, so it stays one line; control characters are shown, not done.
    The cursor waits on an empty line above it and above the `board`, lines that may stand over it:
    what others write, as a log does, goes there and stays, and the rest moves down.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._is_terminal = understands_escapes(stream)
        self._in_ascii = not _encodes(stream, FULL)
        self._shown = ''
        self._told = ''
        self._below = 0  # lines below the cursor
        self._shown_at = -math.inf

    def show(
        self,
        compose: Callable[[int], str],
        now: float,
        board: Callable[[int, int], Sequence[Line]] = lambda width, height: (),
        plain: Callable[[], str] = str,
    ) -> None:
        """
        Show a text, unless the last one is younger than the refresh period; `now` in [s].

        `compose` is asked for a text of so many columns at most, `board` for the lines above it in
        a window of so many columns and lines; `plain` is asked where nothing can be rewritten.
        """
        if now - self._shown_at < LINE_PERIOD:
            return
        if not self._is_terminal:
            self._shown_at = now
            self._tell(visible(plain()))
            return
        if not may_draw_on(self._stream):
            return
        size = shutil.get_terminal_size()
        width = max(size.columns - 1, 0)
        last = visible(compose(width))[:width]
        above = [styled(line, self._in_ascii) for line in board(width, size.lines)]
        text = f'\r{last}\x1b[K'
        is_alone = size.lines < _ROOM  # what others write then has to go behind it
        if not is_alone:
            lines = '\x1b[K\r\n'.join(['', *above, last])
            text = f'\r{lines}\x1b[J\r\x1b[{len(above) + 1}A'
        elif self._below:
            text = f'\r\x1b[J{text}'
        # Where there is no room for it, a later one will do.
        if text == self._shown or offer(self._stream, text):
            self._shown, self._below = text, 0 if is_alone else len(above) + 1
        self._shown_at = now

    def _tell(self, text: str) -> None:
        """Write a text as a line of its own, if it is one and is new."""
        if text and text != self._told and offer(self._stream, f'{text}\n'):
            self._told = text

    def print(self, lines: Sequence[str]) -> None:
        """Write lines above the status, which comes again below them."""
        clear = ('\r\x1b[J' if self._below else '\r\x1b[K') if self._shown else ''
        text = folded([*map(visible, lines)], self._stream)
        offer(self._stream, f'{clear}{text}\n', PATIENCE)
        self.refresh()

    def refresh(self) -> None:
        """Show the next text at once: what stood here is no longer to be seen."""
        self._shown, self._below = '', 0
        self._shown_at = -math.inf

    def close(self) -> None:
        """Leave the last text behind and go to the next line."""
        if self._shown:
            down = f'\x1b[{self._below}B\r' if self._below else ''
            offer(self._stream, f'{down}\n', PATIENCE)
            self._shown, self._below = '', 0
