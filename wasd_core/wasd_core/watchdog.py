# SPDX-License-Identifier: Apache-2.0
"""The dead man's switch: a command counts only while its source is known to be alive."""

import math


class Watchdog:
    """
    Knows how long ago a source was last heard, and whether it still counts.

    It reads no clock: `step` is told what has really passed [s], however much that is, so a
    stopped process that goes on, a slow topic or a coarse period cannot stretch the time-out.
    A source that was never heard is dead. A time-out of 0 or less never ends what was heard.
    """

    def __init__(self, timeout: float) -> None:
        """Take the time-out [s]; it may be changed while the source is alive."""
        self.timeout = timeout
        self.age = math.inf

    @property
    def is_alive(self) -> bool:
        """Whether the source was heard, and not longer ago than the time-out."""
        return math.isfinite(self.age) and not self.age > self.timeout > 0.0

    def hear(self, age: float = 0.0) -> None:
        """Note a sign of life that is `age` [s] old."""
        self.age = age

    def step(self, dt: float) -> None:
        """Let `dt` [s] pass; a time that runs backwards does not make the source younger."""
        self.age += max(dt, 0.0)

    def reset(self) -> None:
        """Be as if the source had never been heard."""
        self.age = math.inf
