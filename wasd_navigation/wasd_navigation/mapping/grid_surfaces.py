# SPDX-License-Identifier: Apache-2.0
"""Surfaces that a grid shows: occupied cells with the direction that they face, and posts."""

import math

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.mapping.local_map import add_surfaces, CELL, LocalMap, make_local_map
from wasd_navigation.records import FREE, Grid, OCCUPIED

# Cells whose nearest free cell is farther than this are inside of something [cells].
DEPTH = 2
# A post is no larger than so many cells each way; at most so many are looked for.
POST_CELLS, MOST_POSTS = 3, 10_000
# Normals are smoothed over neighbours within so many cells.
SMOOTHED = 3


def make_grid_map(grid: Grid) -> LocalMap:
    """Return the surfaces of a grid: occupied cells near free ones, which they face; and posts."""
    occupied, free = grid.cells == OCCUPIED, grid.cells == FREE
    posts = _take_posts(occupied, free)
    cells, normals = _find_facing(occupied, free)
    points = np.zeros((len(cells) + len(posts), 5))
    points[:, :2] = grid.to_points(np.concatenate((cells, posts)))
    points[: len(cells), 2:4] = normals
    points[:, 4] = 1.0
    size = grid.resolution * np.array(grid.cells.shape[::-1])
    local = make_local_map(0.5 * float(size.max(initial=1.0)) + 2.0 * CELL, len(points) + 1)
    local.clear(np.array(grid.origin) + 0.5 * size)
    begins = np.array((0, len(points)))
    add_surfaces(local, np.zeros((1, 3)), points, begins)
    return local


@jit
def _take_posts(occupied: np.ndarray, free: np.ndarray) -> np.ndarray:
    """
    Return middles (row, column), shape (n, 2), of what is small and free all around.

    Their cells are taken out of `occupied`.
    """
    rows, columns = occupied.shape
    middles, count = np.empty((MOST_POSTS, 2)), 0
    inside = np.empty((POST_CELLS * POST_CELLS, 2), dtype=np.int64)
    for row in range(1, rows - POST_CELLS):
        for column in range(POST_CELLS, columns - POST_CELLS):
            if not occupied[row, column] or count == MOST_POSTS:
                continue
            low, high, last = column, column, row
            inside[0, 0], inside[0, 1] = row, column
            used, at, is_post = 1, 0, True
            while at < used and is_post:
                for r in range(inside[at, 0] - 1, inside[at, 0] + 2):
                    for c in range(inside[at, 1] - 1, inside[at, 1] + 2):
                        if not (0 <= r < rows and 0 <= c < columns and occupied[r, c]):
                            continue
                        is_known = False
                        for index in range(used):
                            is_known |= inside[index, 0] == r and inside[index, 1] == c
                        if is_known:
                            continue
                        low, high, last = min(low, c), max(high, c), max(last, r)
                        is_wide = high - low >= POST_CELLS or last - row >= POST_CELLS
                        if r < row or is_wide or used == len(inside):
                            is_post = False
                            continue
                        inside[used, 0], inside[used, 1] = r, c
                        used += 1
                at += 1
            if not is_post:
                continue
            around, known = 0, 0
            for r in range(row - 1, last + 2):
                for c in range(low - 1, high + 2):
                    around += not occupied[r, c]
                    known += free[r, c]
            if 2 * known < around:
                continue
            x, y = 0.0, 0.0
            for index in range(used):
                occupied[inside[index, 0], inside[index, 1]] = False
                y += inside[index, 0] / used
                x += inside[index, 1] / used
            middles[count, 0], middles[count, 1] = y, x
            count += 1
    return middles[:count].copy()


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
