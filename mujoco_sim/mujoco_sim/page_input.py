# SPDX-License-Identifier: Apache-2.0
"""What the controlling browser says, and whether it is known to be alive."""

from collections import deque
from collections.abc import Callable
import threading
import time

from wasd_core.timing import Watchdog

from mujoco_sim.page_keys import PageKeys

# What is held down on a page counts for so long after it was heard [s]: with every picture.
SILENCE = 0.5
# A page that was not heard for so long is lost, and what it has set moving is stopped [s]: within
# a second, but not between two pictures of a slow one.
LOSS = 0.85
# A key that went down in a longer silence was not pressed now [s]: it may have waited in a queue.
GONE = 2.0
# A page that draws fewer pictures a second than this is slow.
SLOW = 10
# How long pictures are counted [s], and how many at most.
_WINDOW = 1.0
_MOST_PICTURES = 500


class PageInput:
    """
    The one gate for everything that a page commands: keys, sticks, pushes.

    A press is proved by the packet that tells of it, whatever the rate of pictures; what lasts
    counts only while `is_alive`.

    The server's thread calls `hear` and `lose`, the viewer's `wait_for_picture` and `set_typing`,
    the simulation's `take_keys`. What is not a key asks `is_alive`.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Take a clock of wall time [s]."""
        self._clock = clock
        self._lock = threading.Condition()
        self._life = Watchdog(SILENCE)
        self._presence = Watchdog(LOSS)
        self._keys = PageKeys()
        self._stepped = clock()
        self._source: object | None = None
        self._is_typing = False
        self._pictures: deque[float] = deque(maxlen=_MOST_PICTURES)
        self._undrawn = False

    @property
    def is_alive(self) -> bool:
        """Whether the controlling browser was heard within SILENCE."""
        with self._lock:
            self._step()
            return self._life.is_alive

    @property
    def is_present(self) -> bool:
        """Whether the controlling browser was heard within LOSS: it may only be slow."""
        with self._lock:
            self._step()
            return self._presence.is_alive

    @property
    def has_source(self) -> bool:
        """Whether a browser that has been heard is still connected, silent or not."""
        return self._source is not None

    @property
    def rate(self) -> int | None:
        """How many pictures the browser has drawn in the last second; None for a new one."""
        with self._lock:
            now = self._clock()
            if not self._pictures or now - self._pictures[0] < _WINDOW:
                return None
            return sum(now - at <= _WINDOW for at in self._pictures)

    @property
    def is_slow(self) -> bool:
        """Whether the browser draws fewer than SLOW pictures a second."""
        rate = self.rate
        return rate is not None and rate < SLOW

    def hear(self, source: object, down: frozenset[int]) -> None:
        """Take what a browser sends with each picture that it draws: the keys that are down."""
        with self._lock:
            self._step()
            if source is not self._source:
                self._end_life()
                self._source = source
                self._pictures.clear()
            if self._is_typing or self._life.age > GONE:
                self._keys.ignore_down()
            now = self._clock()
            since = now - self._pictures[-1] if self._pictures else 0.0
            self._keys.report(down, since)
            self._life.hear()
            self._presence.hear()
            self._pictures.append(now)
            self._undrawn = True
            self._lock.notify_all()

    def lose(self, source: object) -> None:
        """Take that a browser's connection has ended."""
        with self._lock:
            if source is self._source:
                self._end_life()
                self._source = None

    def set_typing(self, is_typing: bool) -> None:
        """Take whether the keys are for a field of text on the page."""
        with self._lock:
            if is_typing and not self._is_typing:
                self._keys.ignore_down()
            self._is_typing = is_typing

    def wait_for_picture(self, timeout: float) -> bool:
        """
        Wait at most `timeout` [s] for the browser to have drawn another picture.

        Only then is it sent a new one: what it cannot take would queue, and be old when shown.
        """
        with self._lock:
            self._lock.wait_for(lambda: self._undrawn, timeout)
            undrawn, self._undrawn = self._undrawn, False
            return undrawn

    def take_keys(self) -> list[str]:
        """
        Return presses, repeats, HELD and RELEASE since the last call, in order.

        LOST stands where the controlling browser had gone or fallen silent.
        """
        with self._lock:
            self._step()
            return self._keys.take()

    def _step(self) -> None:
        """Let the time pass that has passed."""
        now = self._clock()
        dt, self._stepped = now - self._stepped, now
        was_present = self._presence.is_alive
        self._life.step(dt)
        self._presence.step(dt)
        if self._life.is_alive:
            self._keys.step(dt)
        elif was_present and not self._presence.is_alive:
            self._keys.lose()
            self._undrawn = False

    def _end_life(self) -> None:
        if self._source is not None:
            self._keys.lose()
            self._keys.ignore_down()
        self._life.reset()
        self._presence.reset()
        self._undrawn = False
