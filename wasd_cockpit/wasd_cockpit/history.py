# SPDX-License-Identifier: Apache-2.0
"""The last samples of a run, always in one piece, and what their columns mean."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

# Seconds that the plots show, and samples a second.
SPAN, RATE = 10.0, 50.0


@dataclass(frozen=True)
class Columns:
    """
    Which columns of the history mean what.

    Column 0 is the time [s]; then three each of velocities (forward, left [m/s], turn [rad/s]),
    the controller's tick [ms], the real-time factor; then a force [N] and whether the plan has it
    stand for each foot, and the torque of each motor as a share of its limit.
    """

    feet: tuple[str, ...] = ()
    motors: tuple[str, ...] = ()

    COMMAND: ClassVar = 1
    ODOMETRY: ClassVar = 4
    TRUTH: ClassVar = 7
    TICK: ClassVar = 10
    PACE: ClassVar = 11
    FORCES: ClassVar = 12

    @property
    def stances(self) -> int:
        """The first column of the stances."""
        return self.FORCES + len(self.feet)

    @property
    def torques(self) -> int:
        """The first column of the torques."""
        return self.stances + len(self.feet)

    @property
    def width(self) -> int:
        """How many columns there are."""
        return self.torques + len(self.motors)


class History:
    """Keeps the last `length` rows of `width` numbers."""

    def __init__(self, length: int, width: int) -> None:
        self._length = length
        # Twice: so the last rows always lie one after the other.
        self._rows = np.zeros((2 * length, width))
        self._count = 0

    def add(self, row: np.ndarray) -> None:
        """Add a row, shape (width,); what is not finite counts as 0: it cannot be drawn."""
        at = self._count % self._length
        if not np.isfinite(row).all():
            row = np.nan_to_num(row, posinf=0.0, neginf=0.0)
        self._rows[at] = self._rows[at + self._length] = row
        self._count += 1

    def clear(self) -> None:
        """Forget all rows."""
        self._count = 0

    def last(self) -> np.ndarray:
        """Return a copy of the last rows, the oldest first, shape (n, width), n <= length."""
        known = min(self._count, self._length)
        end = self._count % self._length + self._length if known == self._length else known
        return self._rows[end - known : end].copy()
