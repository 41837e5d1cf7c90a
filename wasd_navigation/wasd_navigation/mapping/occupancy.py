# SPDX-License-Identifier: Apache-2.0
"""What is free and what is occupied: log-odds of cells, from rays [Moravec1985]."""

import math

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.grid import FREE
from wasd_navigation.grid import Grid
from wasd_navigation.grid import OCCUPIED
from wasd_navigation.grid import UNKNOWN
from wasd_navigation.scan import Scan

# Log-odds that a ray adds to the cell that it ends in, to each that it goes through, and to the
# one behind its end, as far as that is believed to be occupied.
HIT, MISS, BEHIND = 0.9, -0.25, -0.3
# Nearer to a surface than this a ray does not say that a cell is free [cells].
MARGIN = 0.7
# As far as a cell is believed either way: what has moved is seen after some scans.
MOST, LEAST = 3.0, -3.0
# Above and below these a cell is occupied and free.
OCCUPIED_FROM, FREE_TO = 0.5, -0.5
# By how much the canvas grows when it must [m].
GROWTH = 4.0


class Canvas:
    """Log-odds of a grid that grows with what is drawn; 0 where nothing is known."""

    def __init__(self, resolution: float) -> None:
        self._resolution = resolution
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._odds = np.zeros((0, 0), dtype=np.float32)
        self._corner = np.zeros(2, dtype=np.int64)  # cell (x, y) of the first column and row

    def draw(self, scan: Scan, slants: np.ndarray, pose: np.ndarray) -> None:
        """Draw a scan, with the slants of its `Surface`, taken at a pose of the base."""
        self._cover(scan, pose)
        _draw(
            self._odds,
            (self._resolution, int(self._corner[0]), int(self._corner[1])),
            pose,
            scan.origin,
            scan.ends,
            np.where(scan.hits, slants, 0.0),
        )

    def grid(self) -> Grid:
        """Return what is known of each cell."""
        cells = np.full(self._odds.shape, UNKNOWN, dtype=np.int8)
        cells[self._odds > OCCUPIED_FROM] = OCCUPIED
        cells[self._odds < FREE_TO] = FREE
        corner = self._corner * self._resolution
        return Grid(cells, self._resolution, (float(corner[0]), float(corner[1])))

    def _cover(self, scan: Scan, pose: np.ndarray) -> None:
        """Grow so that a scan lies in it."""
        if not len(scan.ends):
            return
        low, high = _bounds(pose, scan.origin, scan.ends, self._resolution)
        size = np.array(self._odds.shape[::-1])
        end = self._corner + size
        if size.all() and (low >= self._corner).all() and (high <= end).all():
            return
        margin = round(GROWTH / self._resolution)
        if size.all():
            low = np.where(low < self._corner, low - margin, self._corner)
            high = np.where(high > end, high + margin, end)
        grown = np.zeros(tuple((high - low)[::-1].tolist()), dtype=np.float32)
        column, row = (self._corner - low).tolist()
        if size.all():
            grown[row : row + size[1], column : column + size[0]] = self._odds
        self._odds, self._corner = grown, low


@jit
def _bounds(
    pose: np.ndarray, origin: np.ndarray, ends: np.ndarray, resolution: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the first cell (x, y) and that after the last that rays touch, one more around."""
    low, high = np.empty(2), np.empty(2)
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for index in range(-1, ends.shape[0]):
        px, py = origin if index < 0 else ends[index]
        x, y = pose[0] + cos * px - sin * py, pose[1] + sin * px + cos * py
        if index < 0:
            low[0] = high[0] = x
            low[1] = high[1] = y
        low[0], high[0] = min(low[0], x), max(high[0], x)
        low[1], high[1] = min(low[1], y), max(high[1], y)
    first, last = np.floor(low / resolution), np.floor(high / resolution)
    return first.astype(np.int64) - 1, last.astype(np.int64) + 2


@jit
def _draw(
    odds: np.ndarray,
    frame: tuple[float, int, int],
    pose: np.ndarray,
    origin: np.ndarray,
    ends: np.ndarray,
    slants: np.ndarray,
) -> None:
    """
    Add a scan's rays to log-odds; `frame` is resolution and cell (x, y) of the first one.

    `slants`, shape (n,), of each ray is 0 where nothing was hit.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    scale = 1.0 / frame[0]
    x0 = (pose[0] + cos * origin[0] - sin * origin[1]) * scale - frame[1]
    y0 = (pose[1] + sin * origin[0] + cos * origin[1]) * scale - frame[2]
    for ray in range(ends.shape[0]):
        x1 = (pose[0] + cos * ends[ray, 0] - sin * ends[ray, 1]) * scale - frame[1]
        y1 = (pose[1] + sin * ends[ray, 0] + cos * ends[ray, 1]) * scale - frame[2]
        _draw_ray(odds, (x0, y0), (x1, y1), slants[ray])


@jit
def _draw_ray(
    odds: np.ndarray, begin: tuple[float, float], end: tuple[float, float], slant: float
) -> None:
    """Add a ray from one place (x, y) [cells] to another, cell by cell [Amanatides1987]."""
    column, row = int(math.floor(begin[0])), int(math.floor(begin[1]))
    last_column, last_row = int(math.floor(end[0])), int(math.floor(end[1]))
    dx, dy = end[0] - begin[0], end[1] - begin[1]
    step_x, step_y = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
    # Share of the ray from one border of columns (rows) to the next, and up to the first.
    share_x = 1.0 / abs(dx) if dx else np.inf
    share_y = 1.0 / abs(dy) if dy else np.inf
    next_x = share_x * (column + 1 - begin[0] if dx > 0.0 else begin[0] - column) if dx else np.inf
    next_y = share_y * (row + 1 - begin[1] if dy > 0.0 else begin[1] - row) if dy else np.inf
    # From this share on it is nearer to the surface than half a cell: that may fill the cell.
    free = 1.0 - MARGIN / max(0.03, slant) / max(1e-9, math.hypot(dx, dy)) if slant else 1.0
    share = 0.0
    for _ in range(abs(last_column - column) + abs(last_row - row)):
        if share < free:
            odds[row, column] = max(LEAST, odds[row, column] + MISS)
        share = min(next_x, next_y)
        if next_x < next_y:
            column += step_x
            next_x += share_x
        else:
            row += step_y
            next_y += share_y
    if slant == 0.0:
        return
    odds[last_row, last_column] = min(MOST, odds[last_row, last_column] + HIT)
    # The cell behind it is hit by noise only, where no ray goes through to say so.
    if next_x < next_y:
        column += step_x
    else:
        row += step_y
    if 0 <= row < odds.shape[0] and 0 <= column < odds.shape[1] and odds[row, column] > 0.0:
        odds[row, column] = max(0.0, odds[row, column] + BEHIND)
