# SPDX-License-Identifier: Apache-2.0
"""What the live scan shows and the map does not: marked where rays end, fading where they pass."""

import math

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.grid import Grid
from wasd_navigation.scan import Scan
from wasd_navigation.se2 import transform

# A mark is gone after so many scans whose rays go through it.
_LIFE = 3
# What is nearer to an obstacle of the map is that obstacle, by noise of scan and pose [m]; more is
# allowed by an error of the heading, up to the latter. Of a box that is less deep than the former
# before a wall, noise of the ranges marks some cells from near by, in time to stop.
_OF_THE_MAP, _OF_THE_MAP_FAR, _PER_METRE = 0.06, 0.12, 0.03
# Farther hits mark nothing: a small error of the heading is a large one there [m].
_REACH = 4.0
# What is marked is taken to be so deep, as seen from the robot, until its other side is seen [m].
_DEPTH = 0.4


class ObstacleLayer:
    """
    Marks on the cells of a grid; they stay where they are when the grid grows.

    `marks`, uint8, shape of the grid's cells, 0 where nothing is. `is_new` says whether they
    changed since `take` was called.
    """

    def __init__(self) -> None:
        self.marks = np.zeros((0, 0), np.uint8)
        self._grid: Grid | None = None
        self._last = np.zeros((0, 3))  # ends (x, y) [cells], distance that is of the map [m]
        self._begin = np.zeros(2)  # of their rays [cells]
        self.is_new = False

    def forget(self) -> None:
        """Forget all marks but those of the last scan."""
        before, self.marks = self.marks, np.zeros_like(self.marks)
        _mark(self.marks, self._last, np.full(before.shape, np.float32(np.inf)))
        self.marks[before == 0] = 0
        self.is_new = self.is_new or bool(((self.marks > 0) != (before > 0)).any())

    def lie_on(self, grid: Grid) -> None:
        """Have the cells of a grid from now on."""
        old, marks = self._grid, self.marks
        self._grid = grid
        same = old is not None and old.origin == grid.origin
        if same and marks.shape == grid.cells.shape:
            return
        self.marks = np.zeros(grid.cells.shape, np.uint8)
        self._last = self._last[:0]
        self.is_new = True
        cells = np.argwhere(marks)
        if old is None or not len(cells):
            return
        moved = grid.to_cells(old.to_points(cells))
        inside = grid.covers(moved)
        self.marks[tuple(moved[inside].T)] = marks[tuple(cells[inside].T)]

    def see(self, scan: Scan, pose: np.ndarray, distances: np.ndarray, clear_of: float) -> None:
        """
        Take a scan from a pose in the map, shape (3,).

        `distances` [m], shape of the cells, are those to obstacles of the map. Hits no farther
        than `clear_of` [m] from the robot's middle are the robot.
        """
        assert self._grid is not None
        grid = self._grid
        corner = np.array(grid.origin)
        begin = (transform(pose, scan.origin[None])[0] - corner) / grid.resolution
        ends = (transform(pose, scan.ends) - corner) / grid.resolution
        lengths = np.hypot(scan.ends[:, 0], scan.ends[:, 1])
        marks_it = scan.hits & (lengths > clear_of) & (lengths < _REACH)
        before = self.marks > 0
        _trace(self.marks, begin, ends, scan.hits)
        of_map = np.minimum(_OF_THE_MAP + _PER_METRE * lengths, _OF_THE_MAP_FAR)
        self._last, self._begin = np.column_stack((ends, of_map))[marks_it], begin
        _mark(self.marks, self._last, distances)
        self.is_new = self.is_new or bool(((self.marks > 0) != before).any())

    @property
    def hidden(self) -> np.ndarray:
        """Which cells the last scan could not see for what it has marked, bool."""
        assert self._grid is not None
        hidden = np.zeros(self.marks.shape, np.bool_)
        _shade(hidden, self.marks, self._begin, self._last, _DEPTH / self._grid.resolution)
        return hidden

    def take(self) -> np.ndarray:
        """Return which cells are marked, bool; from now on `is_new` looks for changes anew."""
        self.is_new = False
        return self.marks > 0


@jit
def _trace(marks: np.ndarray, begin: np.ndarray, ends: np.ndarray, hits: np.ndarray) -> None:
    """Let marks fade that lie under rays, from `begin` to each of `ends` (x, y) in cells."""
    rows, columns = marks.shape
    passed = np.zeros((rows, columns), np.bool_)
    for ray in range(ends.shape[0]):
        along_x, along_y = ends[ray, 0] - begin[0], ends[ray, 1] - begin[1]
        length = math.hypot(along_x, along_y)
        # The cell that was hit, and the one before it, are not passed.
        count = int((length - 1.5 if hits[ray] else length) * 2.0)
        for step in range(count):
            share = 0.5 * step / length
            column = int(math.floor(begin[0] + share * along_x))
            row = int(math.floor(begin[1] + share * along_y))
            if 0 <= row < rows and 0 <= column < columns:
                passed[row, column] = marks[row, column] > 0
    for row in range(rows):
        for column in range(columns):
            if passed[row, column]:
                marks[row, column] -= 1


@jit
def _mark(marks: np.ndarray, ends: np.ndarray, distances: np.ndarray) -> None:
    """
    Mark where rays end, unless the map has an obstacle there.

    `ends`, shape (n, 3), are x, y [cells], and how near to an obstacle that is [m].
    """
    rows, columns = marks.shape
    for ray in range(ends.shape[0]):
        column, row = int(math.floor(ends[ray, 0])), int(math.floor(ends[ray, 1]))
        if 0 <= row < rows and 0 <= column < columns and distances[row, column] > ends[ray, 2]:
            marks[row, column] = _LIFE


@jit
def _shade(
    hidden: np.ndarray, marks: np.ndarray, begin: np.ndarray, ends: np.ndarray, depth: float
) -> None:
    """Tell which cells are up to `depth` [cells] behind marks that rays end in; see `_mark`."""
    rows, columns = marks.shape
    for ray in range(ends.shape[0]):
        x, y = ends[ray, 0], ends[ray, 1]
        column, row = int(math.floor(x)), int(math.floor(y))
        if not (0 <= row < rows and 0 <= column < columns and marks[row, column] > 0):
            continue
        length = max(math.hypot(x - begin[0], y - begin[1]), 1e-9)
        for step in range(int(2.0 * depth)):
            share = 0.5 * step / length
            column = int(math.floor(x + share * (x - begin[0])))
            row = int(math.floor(y + share * (y - begin[1])))
            if 0 <= row < rows and 0 <= column < columns:
                hidden[row, column] = True
