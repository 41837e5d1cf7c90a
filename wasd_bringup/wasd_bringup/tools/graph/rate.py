# SPDX-License-Identifier: Apache-2.0
"""The rate at which messages come."""

from collections import deque
import math
from typing import NamedTuple


class Rate(NamedTuple):
    """Messages a second, and the gaps [s] between messages that it is the mean of."""

    average: float
    shortest: float
    longest: float
    deviation: float
    window: int

    def __str__(self) -> str:
        """Return the two lines that ros2cli prints."""
        return (
            f'average rate: {self.average:.3f}\n'
            f'\tmin: {self.shortest:.3f}s max: {self.longest:.3f}s '
            f'std dev: {self.deviation:.5f}s window: {self.window}'
        )


class RateMeter:
    """Keeps the gaps between the last `window` messages."""

    def __init__(self, window: int) -> None:
        self._gaps: deque[float] = deque(maxlen=window)
        self._last: float | None = None

    def add(self, now: float) -> None:
        """Count a message that came at a time [s]."""
        if self._last is not None:
            self._gaps.append(now - self._last)
        self._last = now

    def rate(self) -> Rate | None:
        """Return the rate; None before the second message."""
        gaps = self._gaps
        if not gaps:
            return None
        mean = sum(gaps) / len(gaps)
        variance = sum((gap - mean) ** 2 for gap in gaps) / len(gaps)
        average = 1.0 / mean if mean > 0.0 else 0.0
        return Rate(average, min(gaps), max(gaps), math.sqrt(variance), len(gaps))
