# SPDX-License-Identifier: Apache-2.0
"""The grid of all places, drawn as they come, and drawn anew when they have moved."""

import numpy as np

from wasd_navigation.grid import Grid
from wasd_navigation.mapping.occupancy import Canvas
from wasd_navigation.mapping.places import Places

# So many places are drawn in one step.
PORTION = 2
# Places that have moved less are not drawn anew [m], [rad].
LEAST_MOVE, LEAST_TURN = 0.01, 0.004


class Drawing:
    """
    Keeps a finished canvas, and while places are drawn anew a second one.

    `revision` counts changes of the finished one.
    """

    def __init__(self, resolution: float) -> None:
        self._resolution = resolution
        self.revision = 0
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._canvas, self._next = Canvas(self._resolution), Canvas(self._resolution)
        self._where, self._next_where = np.zeros((0, 3)), np.zeros((0, 3))
        self._is_anew = False
        self._grid: tuple[int, Grid] | None = None
        self.revision += 1

    @property
    def grid(self) -> Grid:
        """What is known of each cell."""
        if self._grid is None or self._grid[0] != self.revision:
            self._grid = self.revision, self._canvas.grid()
        return self._grid[1]

    def add_last(self, places: Places) -> None:
        """Draw the last place."""
        self._where = self._draw(self._canvas, self._where, places, len(places))
        self.revision += 1

    def see_moves(self, places: Places) -> None:
        """Begin to draw anew if places have moved since they were drawn."""
        moved = np.abs(places.poses[: len(self._where)] - self._where)
        if not self._is_anew and (moved > (LEAST_MOVE, LEAST_MOVE, LEAST_TURN)).any():
            self._is_anew = True
            self._next.clear()
            self._next_where = np.zeros((0, 3))

    def work(self, places: Places) -> None:
        """Draw some places anew, and show them when all are drawn."""
        if not self._is_anew:
            return
        end = min(len(places), len(self._next_where) + PORTION)
        self._next_where = self._draw(self._next, self._next_where, places, end)
        if end == len(places):
            self._canvas, self._next = self._next, self._canvas
            self._where = self._next_where
            self._is_anew = False
            self.revision += 1

    def _draw(self, canvas: Canvas, where: np.ndarray, places: Places, end: int) -> np.ndarray:
        """Draw places up to `end` and return where all that are drawn were then."""
        poses = places.poses[len(where) : end].copy()
        for number, pose in enumerate(poses, start=len(where)):
            canvas.draw(places.scans[number], places.slants[number], pose)
        return np.concatenate((where, poses))
