# SPDX-License-Identifier: Apache-2.0
"""
The distance from each cell to the nearest obstacle.

Exact squared distances by two passes of lower envelopes of parabolas (Felzenszwalb and
Huttenlocher, Distance Transforms of Sampled Functions, 2012); the first pass, over a binary
picture, is two sweeps.
"""

import functools
import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

# How what runs most often is compiled: sums in any order, no checks of divisions.
fast = functools.partial(jit, error_model='numpy', fastmath={'contract', 'reassoc', 'arcp', 'nsz'})
# Farther than this nothing is looked for [m].
FARTHEST = 5.0


class Field(NamedTuple):
    """
    A value per cell, of each of one or more headings that share the full turn equally.

    `values`, shape (headings, rows, columns), float32; row 0 has the lowest y. `x`, `y` [m] are
    the centre of the cell (0, 0) in the map frame, `resolution` the length of a cell [m].
    """

    values: np.ndarray
    x: float
    y: float
    resolution: float


@jit
def measure_distances(occupied: np.ndarray, resolution: float) -> np.ndarray:
    """
    Return distances [m], shape (rows, columns), float32, of cells `occupied`, bool, same shape.

    From the centre of a cell to the nearest edge of an occupied cell ahead: the distance of the
    centres less half a cell; negative within obstacles, at most FARTHEST.
    """
    rows, columns = occupied.shape
    far = int(math.ceil(FARTHEST / resolution)) + 1
    upright = np.empty((rows, columns), np.int64)
    for column in range(columns):
        last = -far
        for row in range(rows):
            if occupied[row, column]:
                last = row
            upright[row, column] = min(row - last, far)
        last = rows + far
        for row in range(rows - 1, -1, -1):
            if occupied[row, column]:
                last = row
            upright[row, column] = min(upright[row, column], last - row)
    distances = np.empty((rows, columns), np.float32)
    tops, borders = np.empty(columns, np.int64), np.empty(columns + 1)
    for row in range(rows):
        _envelope(upright[row], tops, borders, distances[row])
        for column in range(columns):
            distance = math.sqrt(distances[row, column]) * resolution - 0.5 * resolution
            distances[row, column] = min(distance, FARTHEST)
    return distances


@jit
def _envelope(
    heights: np.ndarray, tops: np.ndarray, borders: np.ndarray, squares: np.ndarray
) -> None:
    """Write the least of (x - i)^2 + heights[i]^2 over i at each x to `squares`, shape (n,)."""
    count = heights.shape[0]
    last = 0
    tops[0] = 0
    borders[0], borders[1] = -math.inf, math.inf
    for index in range(1, count):
        meets = _meeting(heights, tops[last], index)
        while meets <= borders[last]:
            last -= 1
            meets = _meeting(heights, tops[last], index)
        last += 1
        tops[last] = index
        borders[last], borders[last + 1] = meets, math.inf
    last = 0
    for index in range(count):
        while borders[last + 1] < index:
            last += 1
        squares[index] = (index - tops[last]) ** 2 + heights[tops[last]] ** 2


@jit
def _meeting(heights: np.ndarray, left: int, right: int) -> float:
    """Return where the parabolas of two cells meet, the right one being the lower beyond."""
    rise = heights[right] ** 2 + right**2 - heights[left] ** 2 - left**2
    place: float = rise / (2.0 * (right - left))
    return place


@fast
def look_up(field: Field, layer: int, x: float, y: float) -> float:
    """Return the value of a layer at a point of the map [m], between cells by their share."""
    rows, columns = field.values.shape[1], field.values.shape[2]
    across = min(max((x - field.x) / field.resolution, 0.0), columns - 1.001)
    up = min(max((y - field.y) / field.resolution, 0.0), rows - 1.001)
    column, row = int(across), int(up)
    right, above = across - column, up - row
    values = field.values
    low = (1.0 - right) * values[layer, row, column] + right * values[layer, row, column + 1]
    high = (1.0 - right) * values[layer, row + 1, column]
    high += right * values[layer, row + 1, column + 1]
    value: float = (1.0 - above) * low + above * high
    return value


@jit
def look_up_each(field: Field, layer: int, points: np.ndarray) -> np.ndarray:
    """Return `look_up` of points, shape (n, 2)."""
    found = np.empty(len(points))
    for i in range(len(points)):
        found[i] = look_up(field, layer, points[i, 0], points[i, 1])
    return found
