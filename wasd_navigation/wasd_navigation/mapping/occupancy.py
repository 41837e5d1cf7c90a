# SPDX-License-Identifier: Apache-2.0
"""What is free and what is occupied: log-odds of cells, from rays [Moravec1985]."""

import math

from numba import njit
import numpy as np

from wasd_navigation.grid import FREE
from wasd_navigation.grid import Grid
from wasd_navigation.grid import OCCUPIED
from wasd_navigation.grid import UNKNOWN
from wasd_navigation.scan import Scan

# Log-odds that a ray adds to the cell that it ends in, and to each that it goes through.
HIT, MISS = 0.9, -0.4
# As far as a cell is believed either way: what has moved is seen after some scans.
MOST, LEAST = 4.0, -3.0
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

    def draw(self, scan: Scan, pose: np.ndarray) -> None:
        """Draw a scan that was taken at a pose of the base, shape (3,)."""
        self._cover(scan, pose)
        _draw(
            self._odds,
            (self._resolution, int(self._corner[0]), int(self._corner[1])),
            pose,
            scan.origin,
            scan.ends,
            scan.hits,
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
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        rotation = np.array(((cos, sin), (-sin, cos)))
        points = np.vstack((scan.ends, scan.origin)) @ rotation + pose[:2]
        low = np.floor(points.min(axis=0) / self._resolution).astype(np.int64) - 1
        high = np.floor(points.max(axis=0) / self._resolution).astype(np.int64) + 2
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


@njit(cache=True)
def _draw(
    odds: np.ndarray,
    frame: tuple[float, int, int],
    pose: np.ndarray,
    origin: np.ndarray,
    ends: np.ndarray,
    hits: np.ndarray,
) -> None:
    """Add a scan's rays to log-odds; `frame` is resolution and cell (x, y) of the first one."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    scale = 1.0 / frame[0]
    x0 = (pose[0] + cos * origin[0] - sin * origin[1]) * scale - frame[1]
    y0 = (pose[1] + sin * origin[0] + cos * origin[1]) * scale - frame[2]
    for ray in range(ends.shape[0]):
        x1 = (pose[0] + cos * ends[ray, 0] - sin * ends[ray, 1]) * scale - frame[1]
        y1 = (pose[1] + sin * ends[ray, 0] + cos * ends[ray, 1]) * scale - frame[2]
        column, row = int(math.floor(x0)), int(math.floor(y0))
        last_column, last_row = int(math.floor(x1)), int(math.floor(y1))
        dx, dy = x1 - x0, y1 - y0
        step_x, step_y = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
        # Share of the ray from one border of columns (rows) to the next, and to the first.
        share_x = 1.0 / abs(dx) if dx != 0.0 else np.inf
        share_y = 1.0 / abs(dy) if dy != 0.0 else np.inf
        next_x = share_x * ((column + 1 - x0) if dx > 0.0 else (x0 - column)) if dx else np.inf
        next_y = share_y * ((row + 1 - y0) if dy > 0.0 else (y0 - row)) if dy else np.inf
        for _ in range(abs(last_column - column) + abs(last_row - row)):
            odds[row, column] = max(LEAST, odds[row, column] + MISS)
            if next_x < next_y:
                column += step_x
                next_x += share_x
            else:
                row += step_y
                next_y += share_y
        if hits[ray]:
            odds[last_row, last_column] = min(MOST, odds[last_row, last_column] + HIT)
