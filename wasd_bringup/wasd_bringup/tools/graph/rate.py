# SPDX-License-Identifier: Apache-2.0
"""The rate at which messages come."""

from collections import deque

import numpy as np


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

    def rate(self) -> str:
        """Return messages a second, and their gaps, as ros2cli does; '' before the second one."""
        if not self._gaps:
            return ''
        mean = float(np.mean(self._gaps))
        return (
            f'average rate: {1.0 / mean if mean > 0.0 else 0.0:.3f}\n'
            f'\tmin: {min(self._gaps):.3f}s max: {max(self._gaps):.3f}s '
            f'std dev: {np.std(self._gaps):.5f}s window: {len(self._gaps)}'
        )
