# SPDX-License-Identifier: Apache-2.0
"""What is around the robot: obstacles of the map and of the live scan, and how far they are."""

import numpy as np

from wasd_navigation.grid import FREE
from wasd_navigation.grid import Grid
from wasd_navigation.grid import OCCUPIED
from wasd_navigation.grid import UNKNOWN
from wasd_navigation.parameters import PlanningParameters
from wasd_navigation.planning.distance_field import Field
from wasd_navigation.planning.distance_field import measure_distances
from wasd_navigation.planning.footprint import Footprint
from wasd_navigation.planning.obstacle_layer import ObstacleLayer
from wasd_navigation.scan import Scan


class Surroundings:
    """
    The map with what the live scan adds; distances are measured anew only when something changed.

    `revision` counts those changes.
    """

    def __init__(self, footprint: Footprint, parameters: PlanningParameters) -> None:
        self._footprint, self._parameters = footprint, parameters
        self.layer = ObstacleLayer()
        self.revision = 0
        self.grid: Grid | None = None
        self._grid_revision: int | None = None
        self._of_map = np.zeros((0, 0), np.float32)
        self._distances: Field | None = None

    def take_map(self, grid: Grid, revision: int) -> None:
        """Take the map, which is another one only when its revision is."""
        if self.grid is not None and revision == self._grid_revision:
            return
        self.grid, self._grid_revision = grid, revision
        self._of_map = measure_distances(self._is_wall, grid.resolution)
        self.layer.lie_on(grid)
        self._distances = None

    def see(self, scan: Scan, pose: np.ndarray) -> None:
        """Take a scan from a pose in the map, shape (3,)."""
        self.layer.see(scan, pose, self._of_map, self._footprint.inscribed)

    @property
    def _is_wall(self) -> np.ndarray:
        """Which cells are obstacles of the map, bool."""
        assert self.grid is not None
        walls: np.ndarray = self.grid.cells >= self._parameters.occupied
        return walls

    @property
    def is_unknown(self) -> np.ndarray:
        """Which cells nobody has looked at, bool."""
        assert self.grid is not None
        unknown: np.ndarray = self.grid.cells == UNKNOWN
        return unknown

    @property
    def is_unseen(self) -> np.ndarray:
        """
        Where the robot's middle would come over what nobody knows, bool.

        That is what nobody has looked at, and what hides behind something new: a box is as likely
        as not on the way that leads close around the side of it that has been seen.
        """
        unseen, hidden = self.is_unknown, self.layer.hidden
        if hidden.any():
            distances = measure_distances(hidden, self.map_.resolution)
            unseen |= distances < self._footprint.inscribed
        return unseen

    @property
    def distances(self) -> Field:
        """How far it is to the nearest obstacle of map or scan; one layer."""
        if self._distances is None or self.layer.is_new:
            assert self.grid is not None
            marks, values = self.layer.take(), self._of_map
            if marks.any():
                values = measure_distances(self._is_wall | marks, self.grid.resolution)
            self._distances = self.field_of(values[None])
            self.revision += 1
        return self._distances

    @property
    def prices(self) -> tuple[float, float, float]:
        """
        Room beyond which there is no more than enough [m], and what a metre costs more.

        That without any such room, and that where nobody can say what is there.
        """
        parameters = self._parameters
        return parameters.comfort, parameters.comfort_price, parameters.unknown_price

    @property
    def map_(self) -> Grid:
        """The map, where there is one."""
        assert self.grid is not None
        return self.grid

    def price_of(self, room: np.ndarray) -> np.ndarray:
        """
        Return what a metre costs where there is so much `room` [m], float32; infinite below 0.

        `room` has the map's shape.
        """
        comfort, dearer, unknown = self.prices
        lack = np.clip(1.0 - room / comfort, 0.0, 1.0)
        price = 1.0 + dearer * lack * lack
        price += unknown * self.is_unseen
        return np.where(room >= 0.0, price, np.inf).astype(np.float32)

    def field_of(self, values: np.ndarray, step: int = 1) -> Field:
        """Return values, shape (headings, rows, columns), of every `step`th cell as a field."""
        assert self.grid is not None
        resolution = self.grid.resolution
        x, y = (corner + 0.5 * resolution for corner in self.grid.origin)
        return Field(values, x, y, resolution * step)

    @property
    def costmap(self) -> Grid:
        """
        The cells as Nav2's costmaps have them on a topic.

        100 on an obstacle, 99 where the robot's middle cannot be, then falling to 0 at the edge
        of its comfort; unknown where nobody has looked and nothing is near.
        """
        assert self.grid is not None
        distances = self.distances.values[0]
        reach = self._footprint.inscribed + self._parameters.margin
        share = 1.0 - (distances - reach) / self._parameters.comfort
        cells = np.clip(np.round(98.0 * share), FREE, 98).astype(np.int8)
        cells[distances < reach] = 99
        cells[distances < 0.0] = OCCUPIED
        cells[self.is_unknown & (cells == FREE)] = UNKNOWN
        return Grid(cells, self.grid.resolution, self.grid.origin)
