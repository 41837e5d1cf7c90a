# SPDX-License-Identifier: Apache-2.0
"""The surfaces of a grid that was drawn before, to fit scans to."""

import math

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.grid import FREE
from wasd_navigation.grid import Grid
from wasd_navigation.grid import OCCUPIED
from wasd_navigation.mapping.local_map import add_surfaces
from wasd_navigation.mapping.local_map import CELL
from wasd_navigation.mapping.local_map import LocalMap
from wasd_navigation.mapping.local_map import make_local_map

# Cells whose nearest free cell is farther than this are inside of something [cells].
DEPTH = 2
# Normals are smoothed over neighbours within so many cells.
SMOOTHED = 3


def make_grid_map(grid: Grid) -> LocalMap:
    """Return the surfaces of a grid: occupied cells near free ones, which they face."""
    cells, normals = _find_facing(grid.cells == OCCUPIED, grid.cells == FREE)
    points = np.hstack((grid.to_points(cells), normals))
    size = grid.resolution * np.array(grid.cells.shape[::-1])
    local = make_local_map(0.5 * float(size.max(initial=1.0)) + 2.0 * CELL, len(points) + 1)
    local.clear(np.array(grid.origin) + 0.5 * size)
    begins = np.array((0, len(points)))
    add_surfaces(local, np.zeros((1, 3)), points, begins, np.zeros(1, dtype=np.int64))
    return local


@jit
def _find_facing(occupied: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return cells (row, column), shape (n, 2), on surfaces, and normals x, y, shape (n, 2)."""
    rows, columns = occupied.shape
    rough = np.zeros((rows, columns, 2))
    for row in range(rows):
        for column in range(columns):
            if occupied[row, column]:
                _face(free, row, column, rough[row, column])
    cells = np.empty((rows * columns, 2), dtype=np.int64)
    normals = np.empty((rows * columns, 2))
    count = 0
    for row in range(rows):
        for column in range(columns):
            x, y = rough[row, column]
            if x == 0.0 and y == 0.0:
                continue
            sx, sy = 0.0, 0.0
            for r in range(max(0, row - SMOOTHED), min(rows, row + SMOOTHED + 1)):
                for c in range(max(0, column - SMOOTHED), min(columns, column + SMOOTHED + 1)):
                    if rough[r, c, 0] * x + rough[r, c, 1] * y > 0.6:
                        sx += rough[r, c, 0]
                        sy += rough[r, c, 1]
            length = math.hypot(sx, sy)
            cells[count, 0], cells[count, 1] = row, column
            normals[count, 0], normals[count, 1] = sx / length, sy / length
            count += 1
    return cells[:count].copy(), normals[:count].copy()


@jit
def _face(free: np.ndarray, row: int, column: int, out: np.ndarray) -> None:
    """Write the direction from a cell to the free cells around it, near ones more."""
    rows, columns = free.shape
    x, y = 0.0, 0.0
    for r in range(max(0, row - DEPTH), min(rows, row + DEPTH + 1)):
        for c in range(max(0, column - DEPTH), min(columns, column + DEPTH + 1)):
            if free[r, c]:
                dx, dy = c - column, r - row
                square = dx * dx + dy * dy
                x += dx / square**1.5
                y += dy / square**1.5
    length = math.hypot(x, y)
    # Free all around, as a post is: it faces nowhere.
    if length > 0.2:
        out[0], out[1] = x / length, y / length
