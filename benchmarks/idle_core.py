# SPDX-License-Identifier: Apache-2.0
"""Rates on an idle core: one that shares its hardware with somebody is slower."""

from collections.abc import Callable
import math
import statistics
import time
from typing import NamedTuple

# A fixed loop that takes at most so many times its shortest time: nobody shares the core.
IDLE = 1.05


class Rates(NamedTuple):
    """Median rates: in the slices in which the core was idle, None if it never was, and in all."""

    idle: float | None
    overall: float
    idle_slices: int
    slices: int

    def reaches(self, least: float) -> bool:
        """Whether the rate on an idle core was seen and is at least this one."""
        return self.idle is not None and self.idle >= least

    def told(self, digits: int) -> str:
        """Return both, in words."""
        overall = f'{self.overall:.{digits}f} in all'
        if self.idle is None:
            return f'never idle in {self.slices} slices, {overall}'
        share = f'{self.idle_slices} of {self.slices} slices in which it was idle'
        return f'{self.idle:.{digits}f} in the {share}, {overall}'


class IdleCore:
    """
    Tells in which slices of a measurement the core was idle, by a fixed loop before and after.

    The shortest time of the loop shows with time: measure all that belongs together by one.
    """

    def __init__(self) -> None:
        self._shortest = math.inf

    def rates(self, measure: Callable[[], float], slices: int) -> Rates:
        """Return what `measure`, which takes a slice of a second, returns so many times."""
        rates, loops = [], []
        for _ in range(slices):
            before = self._loop()
            rates.append(measure())
            loops.append(max(before, self._loop()))
        most = IDLE * self._shortest
        idle = [rate for rate, loop in zip(rates, loops, strict=True) if loop <= most]
        middle = statistics.median(idle) if idle else None
        return Rates(middle, statistics.median(rates), len(idle), slices)

    def _loop(self) -> float:
        begun, total = time.perf_counter(), 0
        for count in range(200_000):
            total += count
        spent = time.perf_counter() - begun
        self._shortest = min(self._shortest, spent)
        return spent
