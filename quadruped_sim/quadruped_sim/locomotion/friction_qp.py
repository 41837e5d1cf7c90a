# SPDX-License-Identifier: Apache-2.0
"""Quadratic programs over foot forces: friction pyramids and the solver, counted and guarded."""

import math
from typing import NamedTuple

import daqp
import numpy as np


class ForceBounds(NamedTuple):
    """
    Constraints on n forces stacked as (3n,): `lower` <= (x, A x) <= `upper`.

    The last `soft` of them are kept as well as the others allow.
    """

    A: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    soft: int = 0

    def with_soft(self, A: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> 'ForceBounds':
        """Return these and more rows, which are soft."""
        return ForceBounds(
            np.vstack((self.A, A)),
            np.concatenate((self.lower, lower)),
            np.concatenate((self.upper, upper)),
            len(A),
        )


_LARGE = 1e30
_SOFT = 8  # daqp's mark of a constraint that may be violated if there is no other way


class FrictionPyramids:
    """
    Bounds of n feet: force_min <= fz <= force_max and |fx|, |fy| <= friction fz.

    Keeps what it built per n: the horizon of a gait repeats a few sizes.
    """

    def __init__(self, friction: float, force_min: float, force_max: float) -> None:
        self._friction = friction
        self._force_min = force_min
        self._force_max = force_max
        self._cache: dict[int, ForceBounds] = {}

    @property
    def friction(self) -> float:
        """Coefficient in use, in steps of a hundredth."""
        return self._friction

    @friction.setter
    def friction(self, friction: float) -> None:
        rounded = round(friction, 2)
        if rounded != self._friction:
            self._friction = rounded
            self._cache.clear()

    def bounds(self, count: int) -> ForceBounds:
        """Constraints on `count` feet, forces in axes whose z is the ground's normal."""
        if count not in self._cache:
            self._cache[count] = self._build(count)
        return self._cache[count]

    def _build(self, count: int) -> ForceBounds:
        mu, side = self._friction, self._friction * self._force_max
        one = np.array(((1.0, 0.0, -mu), (-1.0, 0.0, -mu), (0.0, 1.0, -mu), (0.0, -1.0, -mu)))
        A = np.kron(np.eye(count), one)
        lower = np.concatenate(
            (np.tile((-side, -side, self._force_min), count), np.full(4 * count, -_LARGE))
        )
        upper = np.concatenate(
            (np.tile((side, side, self._force_max), count), np.zeros(4 * count))
        )
        return ForceBounds(A, lower, upper)


class QpSolver:
    """
    Minimises x'Hx/2 + g'x inside `ForceBounds` with daqp, a dual active-set method [Arnstrom2022].

    Counts `calls`, `failures` and failures in a row.
    """

    def __init__(self) -> None:
        self.calls = 0
        self.failures = 0
        self.failures_in_a_row = 0

    def restart_count(self) -> None:
        """Start counting failures in a row anew; the totals stay."""
        self.failures_in_a_row = 0

    def solve(self, H: np.ndarray, g: np.ndarray, bounds: ForceBounds) -> np.ndarray | None:
        """Solution (n,), or None when the solver gives up, as it does of a problem with NaN."""
        self.calls += 1
        sense = None
        if bounds.soft:
            sense = np.zeros(len(bounds.upper), dtype=np.int32)
            sense[-bounds.soft :] = _SOFT
        x, _, flag, _ = daqp.solve(H, g, bounds.A, bounds.upper, bounds.lower, sense)
        if flag > 0 and _is_finite(x):
            self.failures_in_a_row = 0
            return np.asarray(x)
        self.failures += 1
        self.failures_in_a_row += 1
        return None


def _is_finite(numbers: np.ndarray) -> bool:
    """Whether nothing is NaN, infinite or beyond 1e150: one product tells."""
    return math.isfinite(float(np.vdot(numbers, numbers)))
