# SPDX-License-Identifier: Apache-2.0
"""Viewers of a world; of the browsers on a page one drives, and others may ask for control."""

from collections.abc import Callable
import math
import threading
import time

# A driver whose hands have rested for so long since somebody asked has given control [s].
GIVEN_AFTER = 10.0


class Turns:
    """
    Who waits for control of a page, and whether its driver must give it up.

    Browsers are called by their session's name. The server's thread calls `ask`, `leave`, `touch`
    and `take_end`, the viewer's `waiting`, `remaining` and `give`.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Take a clock of wall time [s]."""
        self._clock = clock
        self._lock = threading.Lock()
        self._asked: dict[str, float] = {}
        self._touched = -math.inf
        self._is_given = False

    def ask(self, browser: str) -> None:
        """Take that a browser asks for control."""
        with self._lock:
            self._asked.setdefault(browser, self._clock())

    def leave(self, browser: str) -> None:
        """Take that a browser waits no more: it has gone, or has got control."""
        with self._lock:
            self._asked.pop(browser, None)
            # If no browser waits any more, nothing is given: the next one that asks has to wait.
            self._is_given &= bool(self._asked)

    def touch(self) -> None:
        """Take that the driver's hands do something."""
        self._touched = self._clock()

    def give(self) -> None:
        """Give control to the one who has waited longest, if somebody does."""
        with self._lock:
            self._is_given = bool(self._asked)

    @property
    def waiting(self) -> int:
        """How many wait."""
        return len(self._asked)

    @property
    def remaining(self) -> float:
        """How long [s] until control goes, if the driver's hands go on to rest; inf for never."""
        with self._lock:
            first = min(self._asked.values(), default=math.inf)
        return max(0.0, max(first, self._touched) + GIVEN_AFTER - self._clock())

    def take_end(self) -> bool:
        """Return, once, whether the turn of the one who drives is over."""
        is_over = bool(self.waiting) and (self._is_given or self.remaining == 0.0)
        if is_over:
            # The next turn begins now; a browser that does not take it must ask again.
            with self._lock:
                del self._asked[next(iter(self._asked))]
                self._is_given = False
            self.touch()
        return is_over
