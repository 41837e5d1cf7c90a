# SPDX-License-Identifier: Apache-2.0
"""Places where a robot may be, until one of them is left."""

from collections.abc import Callable
from dataclasses import dataclass
import math

import numpy as np

from wasd_navigation.mapping.local_map import Fit
from wasd_navigation.mapping.search import Found
from wasd_navigation.se2 import compose
from wasd_navigation.se2 import wrap

# At most so many are looked at, these far apart at least [m], [rad].
MOST, APART, TURNED = 8, 0.4, 0.3
# The pose of one is known so well: standard deviations [m], [rad].
PRIOR = np.diag((1.0 / 0.15**2, 1.0 / 0.15**2, 1.0 / 0.06**2))
# One is given up when by so much, in sum, less of the scans fits than with the best of them, after
# what is allowed for each [Page1954]; or when less than this fits at all.
WORSE, ALLOWED, LEAST = 0.5, 0.02, 0.55
# Scans that the last one left, or one that was asked for, must have fitted.
SCANS = 3


@dataclass
class Hypothesis:
    """A pose, how much of the last scan fits there, and by how much less has fitted in sum."""

    pose: np.ndarray
    share: float
    deficit: float
    information: np.ndarray
    scans: int = 0


class Hypotheses:
    """Some poses, the best first; each `judge` gives up those that fit worse."""

    def __init__(self) -> None:
        self._all: list[Hypothesis] = []

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._all)

    def take(self, found: Found, moved: np.ndarray) -> None:
        """Begin with what a search has found, from where the robot has moved since."""
        for pose, score in zip(found.poses, found.scores, strict=True):
            if len(self._all) == MOST:
                break
            if not any(_is_near(pose, other.pose) for other in self._all):
                self._all.append(Hypothesis(pose, float(score), 0.0, np.zeros((3, 3))))
        self.move(moved)

    def move(self, move: np.ndarray) -> None:
        """Move all as the robot has moved."""
        for each in self._all:
            each.pose = compose(each.pose, move)

    def judge(
        self, fit: Callable[[np.ndarray, np.ndarray, np.ndarray], Fit], surface: np.ndarray
    ) -> None:
        """See how a scan fits at each."""
        for each in self._all:
            fitted = fit(surface, each.pose, PRIOR)
            each.pose, each.information = fitted.pose, fitted.information
            each.share = fitted.share
            each.scans += 1
        most = max((each.share for each in self._all), default=0.0)
        for each in self._all:
            each.deficit = max(0.0, each.deficit + most - each.share - ALLOWED)
        self._all.sort(key=lambda each: (each.deficit, -each.share))
        kept: list[Hypothesis] = []
        for each in self._all:
            is_worse = each.deficit > WORSE or (each.share < LEAST and each.scans > 1)
            if not is_worse and not any(_is_near(each.pose, other.pose) for other in kept):
                kept.append(each)
        self._all = kept

    def best(self) -> Hypothesis | None:
        """Return the one that fits best."""
        return self._all[0] if self._all else None

    def is_decided(self, was_told: bool) -> bool:
        """Whether one is left, or the robot was told where it is: the best is meant."""
        return (len(self._all) == 1 or was_told) and self._all[0].scans >= SCANS


def _is_near(first: np.ndarray, second: np.ndarray) -> bool:
    away = math.hypot(first[0] - second[0], first[1] - second[1])
    return away < APART and abs(wrap(first[2] - second[2])) < TURNED
