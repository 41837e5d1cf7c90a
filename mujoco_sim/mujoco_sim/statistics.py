# SPDX-License-Identifier: Apache-2.0
"""How long ticks take: median, tail, overruns."""

from typing import NamedTuple

import numpy as np


class TickSummary(NamedTuple):
    """Durations of a periodic task [microseconds]; an overrun took longer than its period."""

    median_us: float
    p99_us: float
    max_us: float
    overruns: int


# So many runs are remembered one by one: two minutes at 500 Hz, half a megabyte.
REMEMBERED = 60_000


class TickStatistics:
    """
    Collects the wall-clock durations of a task with a period [s].

    The longest run and overruns are of all runs, however many; median and 99th percentile are of
    the last REMEMBERED ones, so that memory does not grow with the run.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._durations = np.zeros(REMEMBERED)
        self._count = 0
        self._overruns = 0
        self._longest = 0.0

    def add(self, duration: float) -> None:
        """Count one run that took so long [s]."""
        self._durations[self._count % REMEMBERED] = duration
        self._count += 1
        self._overruns += duration > self._period
        self._longest = max(self._longest, duration)

    def summary(self, last: int | None = None) -> TickSummary:
        """
        Return the figures of all runs, or of the `last` ones; zeros before the first.

        `last` is at most REMEMBERED.
        """
        known = min(self._count, REMEMBERED)
        count = min(last, known) if last else known
        if not count:
            return TickSummary(0.0, 0.0, 0.0, 0)
        durations = self._durations[np.arange(self._count - count, self._count) % REMEMBERED]
        longest, overruns = self._longest, self._overruns
        if last:
            longest, overruns = durations.max(), (durations > self._period).sum()
        micro = 1e6 * durations
        return TickSummary(
            round(float(np.median(micro)), 1),
            round(float(np.percentile(micro, 99)), 1),
            round(float(1e6 * longest), 1),
            int(overruns),
        )
