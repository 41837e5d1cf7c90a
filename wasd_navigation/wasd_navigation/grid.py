# SPDX-License-Identifier: Apache-2.0
"""An occupancy grid, as nav_msgs/OccupancyGrid has it."""

from dataclasses import dataclass

import numpy as np

UNKNOWN, FREE, OCCUPIED = -1, 0, 100


@dataclass(frozen=True)
class Grid:
    """
    Cells, shape (rows, columns), int8: -1 unknown, 0 free, to 100 occupied.

    Row 0 is the lowest y, column 0 the lowest x; `origin` (x, y) [m] is the corner of cell
    (0, 0) with the lowest coordinates, `resolution` the length of a cell [m]. Axes are those of
    the map frame.
    """

    cells: np.ndarray
    resolution: float
    origin: tuple[float, float]

    def to_cells(self, points: np.ndarray) -> np.ndarray:
        """Return (row, column), shape (n, 2), of points, shape (n, 2) [m]; maybe outside."""
        steps = np.floor((points - np.array(self.origin)) / self.resolution)
        cells: np.ndarray = steps[:, ::-1].astype(np.int64)
        return cells

    def to_points(self, cells: np.ndarray) -> np.ndarray:
        """Return the centres [m], shape (n, 2), of cells (row, column), shape (n, 2)."""
        points: np.ndarray = (cells[:, ::-1] + 0.5) * self.resolution + np.array(self.origin)
        return points

    def covers(self, cells: np.ndarray) -> np.ndarray:
        """Return which cells (row, column), shape (n, 2), lie in the grid, shape (n,)."""
        inside: np.ndarray = np.all((cells >= 0) & (cells < self.cells.shape), axis=1)
        return inside
