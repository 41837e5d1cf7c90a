# SPDX-License-Identifier: Apache-2.0
"""What is around the robot, in the map and in the live scan, and how far it is."""

import math

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.parameters import Footprint, PlanningParameters
from wasd_navigation.planning.distances import Field, measure_distances
from wasd_navigation.planning.movers import Movers
from wasd_navigation.records import FREE, Grid, OCCUPIED, OPENED, Scan, UNKNOWN
from wasd_navigation.se2 import transform

# Of a map that is larger than the last of these, so much around the robot is looked at [m];
# another part once the robot is so near to an edge of it [m]. It begins at such a cell.
WINDOW, EDGE, STEP, LARGE = 14.0, 4.5, 4, 17.0
# A mark is gone after so many scans whose rays go through it.
_LIFE = 3
# What is nearer to an obstacle of the map is that obstacle, by noise of scan and pose [m]; more is
# allowed by an error of the heading, up to the latter. Of a box that is less deep than the former
# before a wall, noise of the ranges marks some cells from near by, in time to stop.
_OF_THE_MAP, _OF_THE_MAP_FAR, _PER_METRE = 0.06, 0.12, 0.03
# Movers are farther than this from all obstacles of the map [m].
_OF_THE_MAP_OF_MOVERS = 0.15
# Farther hits mark nothing: a small error of the heading is a large one there [m].
_REACH = 4.0
# What is marked is taken to be so deep, as seen from the robot, until its other side is seen [m].
_DEPTH = 0.4
# The grid before there is a map.
_NOTHING = Grid(np.zeros((0, 0), np.int8), 1.0, (0.0, 0.0))


class ObstacleLayer:
    """
    Marks on the cells of a grid; they stay where they are when the grid grows.

    `marks`, uint8, shape of the grid's cells, 0 where nothing is. `is_new` says whether they
    changed since `take` was called.
    """

    def __init__(self) -> None:
        self.marks = np.zeros((0, 0), np.uint8)
        self._grid = _NOTHING
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
        """Use the cells of a grid from now on."""
        old, marks = self._grid, self.marks
        self._grid = grid
        if old.origin == grid.origin and marks.shape == grid.cells.shape:
            return
        self.marks = np.zeros(grid.cells.shape, np.uint8)
        self._last = self._last[:0]
        self.is_new = True
        cells = np.argwhere(marks)
        if not len(cells):
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

    def has_hit(self, place: np.ndarray, reach: float) -> bool:
        """Return whether the last scan hit something within a reach [m] of a place, shape (2,)."""
        ends = self._last[:, :2] * self._grid.resolution + self._grid.origin - place
        return bool((np.hypot(*ends.T) < reach).any())

    @property
    def hidden(self) -> np.ndarray:
        """Which cells the last scan could not see for what it has marked, bool."""
        hidden = np.zeros(self.marks.shape, np.bool_)
        _shade(hidden, self.marks, self._begin, self._last, _DEPTH / self._grid.resolution)
        return hidden

    def take(self) -> np.ndarray:
        """Return which cells are marked, bool; from now on `is_new` looks for changes again."""
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


def crop(grid: Grid, place: np.ndarray) -> tuple[Grid, tuple[int, int]]:
    """Return what of a large map is around a place, shape (2,), and its first cell there."""
    size = round(WINDOW / grid.resolution)
    if max(grid.cells.shape) * grid.resolution <= LARGE + 1e-6:
        return grid, (0, 0)
    cell = grid.to_cells(place[None, :2])[0]
    # In step with the places of an overview; rounded up, so that a wall at the map's end is in it.
    begins = [
        -int(-min(max(at - size // 2, 0), max(all_ - size, 0)) // STEP) * STEP
        for at, all_ in zip(cell, grid.cells.shape, strict=True)
    ]
    row, column = begins
    x, y = grid.origin
    origin = x + column * grid.resolution, y + row * grid.resolution
    cells = grid.cells[row : row + size, column : column + size]
    return Grid(np.ascontiguousarray(cells), grid.resolution, origin), (row, column)


class Surroundings:
    """
    The map with what the live scan adds; distances are measured again only when something changed.

    `revision` counts those changes; `known` is how much of the map somebody has looked at [m^2].
    Of a large map, `whole`, only the part around the robot counts: `grid`, whose first cell (row,
    column) is `corner`.
    """

    def __init__(self, footprint: Footprint, parameters: PlanningParameters) -> None:
        self._footprint, self._parameters = footprint, parameters
        self.layer = ObstacleLayer()
        self.movers = Movers()
        self.revision = 0
        self.known = 0.0
        self.grid = self.whole = _NOTHING
        self.corner = (0, 0)
        self._grid_revision: int | None = None
        self._of_map = np.zeros((0, 0), np.float32)
        self._distances: Field | None = None

    def take_map(self, grid: Grid, revision: int, place: np.ndarray) -> None:
        """
        Take the map, which is another one only when its revision is.

        Of a large map only the part around a place counts, shape (2,) [m].
        """
        if revision == self._grid_revision and not self._is_near_edge(place):
            return
        self.whole, self._grid_revision = grid, revision
        self.known = np.count_nonzero(grid.cells != UNKNOWN) * grid.resolution**2
        self.grid, self.corner = crop(grid, place)
        self._of_map = measure_distances(self._is_wall, grid.resolution)
        self.layer.lie_on(self.grid)
        self._distances = None

    @property
    def is_windowed(self) -> bool:
        """Whether there is more of the map than is looked at."""
        return self.grid is not self.whole

    def _is_near_edge(self, place: np.ndarray) -> bool:
        """Whether a place is near where the map goes on beyond what is looked at."""
        if not self.is_windowed:
            return False
        near = EDGE / self.whole.resolution
        cell = self.whole.to_cells(place[None, :2])[0]
        sizes = zip(cell, self.corner, self.grid.cells.shape, self.whole.cells.shape, strict=True)
        return any(
            (low > 0 and at - low < near) or (low + size < all_ and low + size - at < near)
            for at, low, size, all_ in sizes
        )

    def at(self, place: np.ndarray) -> 'Surroundings':
        """Return the surroundings of another place of the map, without the live scan."""
        there = Surroundings(self._footprint, self._parameters)
        there.take_map(self.whole, 0, place)
        return there

    def see(self, scan: Scan, pose: np.ndarray) -> None:
        """Take a scan from a pose in the map, shape (3,)."""
        self.layer.see(scan, pose, self._of_map, self._footprint.inscribed)
        points = transform(pose, scan.own_points)
        cells = self.grid.to_cells(points)
        inside = self.grid.covers(cells)
        points, cells = points[inside], cells[inside]
        is_other = self._of_map[tuple(cells.T)] > _OF_THE_MAP_OF_MOVERS
        # Everything in unknown cells is new.
        is_other &= self.grid.cells[tuple(cells.T)] != UNKNOWN
        is_other |= self.movers.are_at(points)  # the map may have taken in who stands
        self.movers.see(points[is_other], transform(pose, scan.origin[None])[0])

    @property
    def _is_wall(self) -> np.ndarray:
        """Which cells are obstacles of the map, bool."""
        walls: np.ndarray = self.grid.cells >= self._parameters.occupied
        return walls

    @property
    def is_unknown(self) -> np.ndarray:
        """The unknown cells, bool."""
        unknown: np.ndarray = self.grid.cells == UNKNOWN
        return unknown

    @property
    def is_unseen(self) -> np.ndarray:
        """
        Cells in which the robot would stand on unseen ground, bool.

        Unseen are unknown cells, and cells hidden behind something new: a box may well reach into
        a way that leads close around its visible side.
        """
        unseen, hidden = self.is_unknown, self.layer.hidden
        if hidden.any():
            distances = measure_distances(hidden, self.grid.resolution)
            unseen |= distances < self._footprint.inscribed
        return unseen

    @property
    def distances(self) -> Field:
        """How far it is to the nearest obstacle of map or scan; one layer."""
        if self._distances is None or self.layer.is_new:
            marks, values = self.layer.take(), self._of_map
            if marks.any():
                values = measure_distances(self._is_wall | marks, self.grid.resolution)
            self._distances = self.field_of(values[None])
            self.revision += 1
        return self._distances

    @property
    def distances_of_goals(self) -> Field:
        """How far it is to the nearest place where no goal may be, an obstacle or OPENED."""
        is_open = self.grid.cells == OPENED
        if not is_open.any():
            return self.distances
        walls = self._is_wall | is_open | (self.layer.marks > 0)
        return self.field_of(measure_distances(walls, self.grid.resolution)[None])

    @property
    def distances_of_map(self) -> Field:
        """How far it is to the nearest obstacle of the map alone; one layer."""
        return self.field_of(self._of_map[None])

    @property
    def prices(self) -> tuple[float, float, float]:
        """Room that is enough [m]; extra costs of a metre without room, and on unseen ground."""
        parameters = self._parameters
        return parameters.comfort, parameters.comfort_price, parameters.unknown_price

    @property
    def occupied(self) -> int:
        """The occupancy from which on a cell is an obstacle."""
        return self._parameters.occupied

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
        distances = self.distances.values[0]
        reach = self._footprint.inscribed + self._parameters.margin
        share = 1.0 - (distances - reach) / self._parameters.comfort
        cells = np.clip(np.round(98.0 * share), FREE, 98).astype(np.int8)
        cells[distances < reach] = 99
        cells[distances < 0.0] = OCCUPIED
        cells[self.is_unknown & (cells == FREE)] = UNKNOWN
        return Grid(cells, self.grid.resolution, self.grid.origin)
