# SPDX-License-Identifier: Apache-2.0
"""How often readings come, and whether that is enough to walk."""

from collections import deque
from itertools import islice

# So many intervals are looked at: a tenth of a second at the usual rate.
INTERVALS = 50
# Fewer say nothing: a stream that has just been found may begin with a gap.
FEWEST = 10
# A longer interval counts as one of this length [s]: one gap alone makes no slow stream.
LONGEST = 0.02
# What comes slowly does so now: most of so many last intervals are too long. Gaps, as a busy
# machine or a process that was stopped leaves them, make no slow stream.
LAST = 7
# A stream of less than this share of the rate that is wanted is too slow.
ENOUGH = 0.8


class Feed:
    """
    The rate of a stream of readings, by their stamps.

    A controller that is fed too slowly answers states that are gone: three states late at 250 Hz,
    a Go2 falls from a fast trot (`benchmarks/state_rates.py`). It reads no clock.
    """

    def __init__(self, wanted: float) -> None:
        """Take the rate that is wanted [Hz]."""
        self.wanted = wanted
        self._intervals: deque[float] = deque()
        self._cut = 0.0  # sum of the intervals, none of them longer than LONGEST
        self._last: float | None = None

    def take(self, stamp: float) -> None:
        """Take a reading's stamp [s]; one that is before the last begins a new stream."""
        previous, self._last = self._last, stamp
        if previous is None or stamp == previous:
            return
        if stamp < previous:
            self._intervals.clear()
            self._cut = 0.0
            return
        if len(self._intervals) == INTERVALS:
            self._cut -= min(self._intervals.popleft(), LONGEST)
        self._intervals.append(stamp - previous)
        self._cut += min(stamp - previous, LONGEST)

    @property
    def rate(self) -> float:
        """Readings a second [Hz]; 0 while too few have come."""
        count = len(self._intervals)
        return count / sum(self._intervals) if count >= FEWEST else 0.0

    @property
    def is_slow(self) -> bool:
        """Whether it is known to come too slowly."""
        count = len(self._intervals)
        if count < FEWEST or count >= ENOUGH * self.wanted * self._cut:
            return False
        last = sorted(islice(reversed(self._intervals), LAST))
        return last[LAST // 2] > 1.0 / (ENOUGH * self.wanted)
