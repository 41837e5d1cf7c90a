# SPDX-License-Identifier: Apache-2.0
"""One line of a terminal that is rewritten in place."""

from collections.abc import Callable, Sequence
import math
import shutil
from typing import TextIO

from wasd_core.streams import offer
from wasd_core.streams import PATIENCE
from wasd_core.streams import visible

from teleop_keyboard.terminal import may_draw_on
from teleop_keyboard.terminal import understands_escapes

# The line is rewritten at most this often: readable, and cheap over a slow connection [s].
REFRESH_PERIOD = 0.1


class StatusLine:
    """
    A line at the cursor that always shows the last text; nothing where the output is no terminal.

    It is written in one piece and only when it changed, so it does not flicker; a text that is
    wider than the window is cut, so it stays one line; control characters are shown, not done.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._is_terminal = understands_escapes(stream)
        self._shown = ''
        self._shown_at = -math.inf

    def show(self, compose: Callable[[int], str], now: float) -> None:
        """
        Show a text, unless the last one is younger than the refresh period; `now` in [s].

        `compose` is asked for a text of so many columns at most.
        """
        if not self._is_terminal or now - self._shown_at < REFRESH_PERIOD:
            return
        if not may_draw_on(self._stream):
            return
        width = max(shutil.get_terminal_size().columns - 1, 0)
        text = visible(compose(width))[:width]
        # Where there is no room for it, a later one will do.
        if text == self._shown or offer(self._stream, f'\r{text}\x1b[K'):
            self._shown = text
        self._shown_at = now

    def print(self, lines: Sequence[str]) -> None:
        """Write lines above the status, which comes again below them."""
        clear = '\r\x1b[K' if self._shown else ''
        offer(self._stream, clear + '\n'.join([*map(visible, lines), '']), PATIENCE)
        self.refresh()

    def refresh(self) -> None:
        """Have the next text shown at once: what stood here is no longer to be seen."""
        self._shown = ''
        self._shown_at = -math.inf

    def close(self) -> None:
        """Leave the last text behind and go to the next line."""
        if self._shown:
            offer(self._stream, '\n', PATIENCE)
            self._shown = ''
