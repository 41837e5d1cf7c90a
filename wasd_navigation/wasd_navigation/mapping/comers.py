# SPDX-License-Identifier: Apache-2.0
"""Finds what has come to where all was free: people, until they stay for a while."""

from collections import deque
import math

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.records import Scan
from wasd_navigation.se2 import transform

# Somebody has come where all cells within this distance have been free [m], by such log-odds, of
# two scans at least. Nearer to a wall what is seen may be the wall, from a pose that is off.
OPEN, SURELY_FREE = 0.2, -1.0
# A person who walks on along a wall is known by his place before: no farther than this [m], in
# one of so many scans before; all within the last distance [m] must be free. A wall that is seen
# from a wrong pose was not there before.
REACH, BEFORE, BESIDE = 0.3, 3, 0.05
# What was there so many scans ago, this near [m], stays: it is part of the place.
STAYS, NEAR = 40, 0.08
# So many scans of that time are compared.
COMPARED = 3


class Comers:
    """
    Leaves those out of scans who have come.

    A robot that is matched against people who walk beside it, in a corridor, is taken to go as
    they do, whatever its wheels say.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Know of nobody."""
        self._seen: deque[np.ndarray] = deque(maxlen=STAYS + COMPARED)
        self._left_out: deque[np.ndarray] = deque(maxlen=BEFORE)

    def leave_out(
        self, scan: Scan, pose: np.ndarray, odds: np.ndarray, frame: tuple[float, int, int]
    ) -> Scan:
        """Return a scan taken at a pose, without them; `odds` and `frame` as of `Canvas.odds`."""
        places = transform(pose, scan.ends)
        measured = scan.hits.copy()
        measured[len(measured) - scan.added :] = False
        came = measured & _are_open(places, odds, frame, OPEN)
        theirs = np.concatenate((np.empty((0, 2)), *self._left_out))
        if len(theirs):
            beside = measured & ~came
            beside[beside] = _are_near(places[beside], theirs, REACH)
            came[beside] = _are_open(places[beside], odds, frame, BESIDE)
        before = list(self._seen)[: max(0, len(self._seen) - STAYS)]
        self._seen.append(places[came])
        came[came] = ~_are_near(places[came], np.concatenate((np.empty((0, 2)), *before)), NEAR)
        self._left_out.append(places[came])
        if not came.any():
            return scan
        left = ~came
        return Scan(scan.origin, scan.ends[left], scan.hits[left], scan.begins[left], scan.added)


@jit
def _are_open(
    places: np.ndarray, odds: np.ndarray, frame: tuple[float, int, int], room: float
) -> np.ndarray:
    """Return around which places, shape (n, 2) [m], all cells in a room [m] are surely free."""
    rows, columns = odds.shape
    reach = math.ceil(room / frame[0])
    are_open = np.ones(places.shape[0], dtype=np.bool_)
    for index in range(places.shape[0]):
        column = int(math.floor(places[index, 0] / frame[0])) - frame[1]
        row = int(math.floor(places[index, 1] / frame[0])) - frame[2]
        # From the middle on: most places are on a wall.
        for ring in range(reach + 1):
            for r in range(row - ring, row + ring + 1):
                step = 1 if abs(r - row) == ring else 2 * ring
                for c in range(column - ring, column + ring + 1, max(1, step)):
                    inside = 0 <= r < rows and 0 <= c < columns
                    if not inside or odds[r, c] > SURELY_FREE:
                        are_open[index] = False
                        break
                if not are_open[index]:
                    break
            if not are_open[index]:
                break
    return are_open


@jit
def _are_near(places: np.ndarray, others: np.ndarray, reach: float) -> np.ndarray:
    """Return which places, shape (n, 2), have one of others, shape (m, 2), within a reach [m]."""
    near = np.zeros(places.shape[0], dtype=np.bool_)
    for index in range(places.shape[0]):
        for other in range(others.shape[0]):
            dx, dy = places[index, 0] - others[other, 0], places[index, 1] - others[other, 1]
            if dx * dx + dy * dy < reach * reach:
                near[index] = True
                break
    return near
