# SPDX-License-Identifier: Apache-2.0
"""Keepout areas: where no path leads, though nothing is there."""

import math

import numpy as np

from wasd_navigation.parameters import Footprint
from wasd_navigation.planning.distances import measure_distances
from wasd_navigation.planning.goal_field import ways_from
from wasd_navigation.records import FREE, Grid, OCCUPIED, OPENED

# What cells of a picture show where keepout areas are.
KEEPOUT = OCCUPIED + 1
# A way out is opened by so much more than the robot is wide [m].
SPARE = 0.1


class Keepout:
    """
    The occupied cells of a mask, which lies in the map's axes.

    They are planned with as obstacles, except those between a robot that stands inside and the
    nearest place outside, which are OPENED.
    """

    def __init__(self, mask: Grid, footprint: Footprint) -> None:
        self.mask = mask
        self._cells = np.argwhere(mask.cells == OCCUPIED)
        self._circles = footprint.circles
        x, y, radius = self._circles[0].tolist()
        self._reach = math.hypot(x, y) + radius + SPARE
        self._on: tuple[Grid, np.ndarray] | None = None

    def has(self, point: np.ndarray) -> bool:
        """Whether a point, shape (2,) [m], is in an area."""
        if not np.isfinite(point).all() or not self.mask.has(point):
            return False
        cell = self.mask.to_cells(point[None])[0]
        return bool(self.mask.cells[tuple(cell)] == OCCUPIED)

    def overlaps(self, pose: np.ndarray) -> bool:
        """Whether a robot at a pose, shape (3,), reaches into an area."""
        corners = np.stack((pose[:2] - self._reach, pose[:2] + self._reach))
        low, high = self.mask.to_cells(corners)
        near = self._cells[((self._cells >= low) & (self._cells <= high)).all(axis=1)]
        if not len(near):
            return False
        points, half = self.mask.to_points(near), 0.5 * self.mask.resolution
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        for x, y, radius in self._circles.tolist():
            at = pose[:2] + (cos * x - sin * y, sin * x + cos * y)
            beyond = np.maximum(np.abs(points - at) - half, 0.0)
            if (np.hypot(*beyond.T) < radius).any():
                return True
        return False

    def on(self, grid: Grid) -> np.ndarray:
        """Return which cells of a grid are in an area, bool."""
        before = self._on
        if before is not None and _is_alike(before[0], grid):
            return before[1]
        is_kept = np.zeros(grid.cells.shape, np.bool_)
        # Cells may be finer than those of the mask, or coarser.
        rows, columns = map(np.arange, grid.cells.shape)
        zeros = np.zeros_like
        ys = grid.to_points(np.column_stack((rows, zeros(rows))))
        xs = grid.to_points(np.column_stack((zeros(columns), columns)))
        at_rows, at_columns = self.mask.to_cells(ys)[:, 0], self.mask.to_cells(xs)[:, 1]
        inside = [
            np.flatnonzero((at >= 0) & (at < size))
            for at, size in zip((at_rows, at_columns), self.mask.cells.shape, strict=True)
        ]
        seen = self.mask.cells[np.ix_(at_rows[inside[0]], at_columns[inside[1]])]
        is_kept[np.ix_(*inside)] = seen == OCCUPIED
        cells = grid.to_cells(self.mask.to_points(self._cells))
        is_kept[tuple(cells[grid.covers(cells)].T)] = True
        self._on = grid, is_kept
        return is_kept

    def applied(self, grid: Grid, pose: np.ndarray | None) -> Grid:
        """Return a grid with the areas as obstacles, for a robot at a pose, shape (3,)."""
        is_kept = self.on(grid)
        if not is_kept.any():
            return grid
        cells = grid.cells.copy()
        cells[is_kept] = OCCUPIED
        if pose is not None and self.overlaps(pose) and grid.has(pose[:2]):
            way_out = self._way_out(grid, is_kept, pose)
            if way_out is None:
                return grid
            is_open = is_kept & way_out
            cells[is_open] = np.where(grid.cells > FREE, grid.cells, OPENED)[is_open]
        return Grid(cells, grid.resolution, grid.origin)

    def _way_out(self, grid: Grid, is_kept: np.ndarray, pose: np.ndarray) -> np.ndarray | None:
        """
        Return which cells are about as near as the nearest where a robot is outside, bool.

        None: no such place is known yet.
        """
        price = np.where(grid.cells == OCCUPIED, np.inf, 1.0).astype(np.float32)
        ways = ways_from(grid.to_cells(pose[None, :2])[0], price, grid.resolution)
        is_outside = measure_distances(is_kept, grid.resolution) >= self._reach
        is_outside &= np.isfinite(price)
        if not is_outside.any():
            return None
        near = ways <= ways[is_outside].min()
        opened: np.ndarray = measure_distances(near, grid.resolution) < self._reach
        return opened

    def shown_on(self, grid: Grid) -> Grid:
        """Return a grid with KEEPOUT where the areas are, for a picture."""
        is_kept = self.on(grid)
        cells = np.where(is_kept & (grid.cells < OCCUPIED), np.int8(KEEPOUT), grid.cells)
        return Grid(cells, grid.resolution, grid.origin)


def _is_alike(first: Grid, second: Grid) -> bool:
    """Whether two grids have their cells at the same places."""
    places = (first.origin, first.resolution) == (second.origin, second.resolution)
    return places and first.cells.shape == second.cells.shape
