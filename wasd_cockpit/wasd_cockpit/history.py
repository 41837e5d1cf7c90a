# SPDX-License-Identifier: Apache-2.0
"""The last samples of a run, always in one piece."""

import numpy as np


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
        self._rows[at] = self._rows[at + self._length] = np.nan_to_num(row, posinf=0.0, neginf=0.0)
        self._count += 1

    def clear(self) -> None:
        """Forget all rows."""
        self._count = 0

    def last(self) -> np.ndarray:
        """Return a copy of the last rows, the oldest first, shape (n, width), n <= length."""
        known = min(self._count, self._length)
        end = self._count % self._length + self._length if known == self._length else known
        return self._rows[end - known : end].copy()
