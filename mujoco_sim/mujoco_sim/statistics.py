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


class TickStatistics:
    """Collects the wall-clock durations of a task with a period [s]."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._durations: list[float] = []

    def add(self, duration: float) -> None:
        """Count one run that took so long [s]."""
        self._durations.append(duration)

    def summary(self, last: int | None = None) -> TickSummary:
        """Return the figures of all runs, or of the `last` ones; zeros before the first."""
        if not self._durations:
            return TickSummary(0.0, 0.0, 0.0, 0)
        durations = np.array(self._durations[-last:] if last else self._durations)
        micro = 1e6 * durations
        return TickSummary(
            round(float(np.median(micro)), 1),
            round(float(np.percentile(micro, 99)), 1),
            round(float(micro.max()), 1),
            int((durations > self._period).sum()),
        )
