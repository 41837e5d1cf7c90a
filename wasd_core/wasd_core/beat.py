# SPDX-License-Identifier: Apache-2.0
"""A rate for what comes at another: publishers of one rate pick the same instants."""

import math

# Sums of periods miss the instant that they mean by some rounding [s].
ROUNDING = 1e-6


class Beat:
    """
    Picks the first instant of each period, counted from time 0, not from the first call.

    Nodes that see the same times pick the same ones, so what they publish has one stamp.
    """

    def __init__(self) -> None:
        self._number: int | None = None

    def is_due(self, now: float, rate: float) -> bool:
        """Whether to publish at a time [s], `rate` times a second; also after a jump back."""
        number = math.floor((now + ROUNDING) * rate)
        before, self._number = self._number, number
        return number != before
