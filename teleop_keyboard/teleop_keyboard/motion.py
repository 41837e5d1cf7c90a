# SPDX-License-Identifier: Apache-2.0
"""Motion keys to a direction: while they are down, until the next one, or step by step."""

from collections.abc import Iterable, Mapping
import math

from teleop_keyboard.hold import KeyHold
from teleop_keyboard.hold import ROUNDING
from teleop_keyboard.keymap import Direction

NOWHERE = Direction()


def combine(directions: Iterable[Direction]) -> Direction:
    """
    Return the sum of directions within full speed.

    Opposites cancel; a diagonal is no faster than straight on: (forward, left, up) has at most
    length 1. Turning has its own limit.
    """
    sums = map(sum, zip(NOWHERE, *directions, strict=True))
    x, y, z, yaw = (min(max(value, -1.0), 1.0) for value in sums)
    length = max(math.hypot(x, y, z), 1.0)
    return Direction(x / length, y / length, z / length, yaw)


class Motion:
    """
    The direction that the motion keys ask for, in one of three modes.

    `hold`: all keys that are down count together. `latch`: the last key counts until the next.
    `step`: each press adds a share of full speed, up to all of it. In the latter two a direction
    ends when no motion key was heard of for `longest` [s]. `step` lets time pass.
    """

    def __init__(self, keys: Mapping[str, Direction], mode: str, share: float) -> None:
        self._keys = keys
        self._hold = KeyHold()
        self._latched = NOWHERE
        self._silence = 0.0
        self.mode = mode
        self.share = share

    @property
    def longest(self) -> float:
        """How long a key counts at most without another word of it [s]."""
        return self._hold.longest

    @longest.setter
    def longest(self, seconds: float) -> None:
        self._hold.longest = seconds

    @property
    def direction(self) -> Direction:
        """Shares of full speed and turn."""
        if self.mode == 'hold':
            return combine(self._keys[key] for key in self._hold.held)
        return self._latched

    @property
    def keys_down(self) -> tuple[str, ...]:
        """The motion keys that count as down, in the order of their first press."""
        return self._hold.held

    @property
    def is_idle(self) -> bool:
        """Whether time alone will change nothing."""
        return self._hold.is_idle

    def press(self, key: str) -> None:
        """Take a press or a repeat of a motion key."""
        self._hold.press(key)
        self._silence = 0.0
        asked = self._keys[key]
        if self.mode == 'latch':
            self._latched = combine([asked])
        elif self.mode == 'step':
            if asked == NOWHERE:
                self._latched = NOWHERE
                return
            values = zip(self._latched, asked, strict=True)
            self._latched = combine([Direction(*(v + self.share * a for v, a in values))])

    def keep_down(self, key: str) -> None:
        """Note that a motion key is down and that its release will be told."""
        if key in self._keys:
            self._hold.keep_down(key)
            self._silence = 0.0

    def release(self, key: str) -> None:
        """Note that a key was released."""
        self._hold.release(key)

    def forget(self) -> None:
        """Ask for standing still."""
        self._hold.clear()
        self._latched = NOWHERE

    def step(self, dt: float) -> None:
        """Let `dt` [s] pass."""
        self._hold.step(dt)
        self._silence += dt
        if self._silence >= self.longest - ROUNDING:
            self._latched = NOWHERE
