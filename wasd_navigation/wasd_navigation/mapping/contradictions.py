# SPDX-License-Identifier: Apache-2.0
"""What of a scan a grid contradicts: what is seen where all is free, or through walls."""

import math

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.mapping.local_map import LocalMap, weigh_points
from wasd_navigation.records import FREE, Grid, OCCUPIED

# What is seen so far behind a wall at least is seen through it [m]: less is noise, or its depth.
BEFORE = 0.3


class Contradictions:
    """
    Counts points of a scan that a grid and its surfaces contradict.

    Points in unknown cells do not count: of two equal rooms, one may be drawn worse.
    """

    def __init__(self, grid: Grid, surfaces: LocalMap, noise: float) -> None:
        """Take a grid with its surfaces, and the deviation of a point on one [m]."""
        self._cells, self._surfaces, self._noise = grid.cells, surfaces, noise
        self._frame = grid.resolution, *grid.origin

    def share(self, surface: np.ndarray, origin: np.ndarray, pose: np.ndarray) -> float:
        """Return that share of a surface, shape (m, 5), seen from an `origin` (2,) at a pose."""
        if not len(surface):
            return 0.0
        against = _count(
            self._surfaces, self._cells, self._frame, surface, origin, pose, self._noise
        )
        return float(against) / len(surface)


@jit
def _count(
    surfaces: LocalMap,
    cells: np.ndarray,
    frame: tuple[float, float, float],
    surface: np.ndarray,
    origin: np.ndarray,
    pose: np.ndarray,
    noise: float,
) -> int:
    """Return how many points of a surface are contradicted; `frame` is resolution, low x and y."""
    against = 0
    out = np.zeros((3, 3)), np.zeros(3)
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    from_x = pose[0] + cos * origin[0] - sin * origin[1]
    from_y = pose[1] + sin * origin[0] + cos * origin[1]
    for index in range(surface.shape[0]):
        x = pose[0] + cos * surface[index, 0] - sin * surface[index, 1]
        y = pose[1] + sin * surface[index, 0] + cos * surface[index, 1]
        if _is_behind_a_wall(cells, frame, from_x, from_y, x, y):
            against += 1
        elif _is_free(cells, frame, x, y):
            against += not weigh_points(surfaces, surface[index : index + 1], pose, noise, out)
    return against


@jit
def _value(cells: np.ndarray, frame: tuple[float, float, float], x: float, y: float) -> int:
    """Return what a cell is at a place [m]; -1 outside."""
    column = int(math.floor((x - frame[1]) / frame[0]))
    row = int(math.floor((y - frame[2]) / frame[0]))
    if row < 0 or column < 0 or row >= cells.shape[0] or column >= cells.shape[1]:
        return -1
    return int(cells[row, column])


@jit
def _is_free(cells: np.ndarray, frame: tuple[float, float, float], x: float, y: float) -> bool:
    """Return whether a place and all cells around it are free."""
    for right in range(-1, 2):
        for up in range(-1, 2):
            if _value(cells, frame, x + right * frame[0], y + up * frame[0]) != FREE:
                return False
    return True


@jit
def _is_behind_a_wall(
    cells: np.ndarray,
    frame: tuple[float, float, float],
    from_x: float,
    from_y: float,
    x: float,
    y: float,
) -> bool:
    """Return whether a ray from one place to another goes through an occupied cell before it."""
    length = math.hypot(x - from_x, y - from_y)
    steps = int((length - BEFORE) / (0.5 * frame[0]))
    for step in range(1, steps):
        share = step * 0.5 * frame[0] / length
        value = _value(cells, frame, from_x + share * (x - from_x), from_y + share * (y - from_y))
        if value == OCCUPIED:
            return True
    return False
