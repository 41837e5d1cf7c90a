# SPDX-License-Identifier: Apache-2.0
"""
The remaining cost across a large map, coarse; other modules plan around the robot.

Places are a few cells wide, and free where the best of their cells has room for the robot. Walls,
grown by that room to both sides, are wider than a place, so no way leads through them.
"""

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.planning.distances import Field, look_up_each, measure_distances
from wasd_navigation.planning.goal_field import follow, Heap, make_heap, march, start_at
from wasd_navigation.planning.surroundings import Surroundings
from wasd_navigation.records import Grid, UNKNOWN

# So many cells are one place each way; rooms are measured in tiles of so many places, and no more
# room than this is told apart [m].
PLACE, TILE, MOST_ROOM = 4, 50, 0.5
# In one step so many tiles are measured, or so many places looked at: 6 ms, 10 on a slow host.
TILES, PLACES = 8, 25_000
_BEYOND = 10.0
_MOST_POINTS = 4000


class Rooms:
    """
    The largest clearance in each place of a map [m], shape (rows, columns), float32.

    `is_known` are the known cells. Only the changed part of a map is measured again.
    """

    def __init__(self) -> None:
        self._grid: Grid | None = None
        self.values: np.ndarray = np.zeros((0, 0), np.float32)
        self.is_known: np.ndarray = np.zeros((0, 0), np.bool_)
        self._waiting: list[tuple[int, int]] = []

    def take(self, grid: Grid, occupied: int) -> None:
        """Take a map, and the occupancy from which on a cell is an obstacle."""
        before, self._grid, self._occupied = self._grid, grid, occupied
        shape = tuple(-(-size // PLACE) for size in grid.cells.shape)
        tiles = [
            (row, column)
            for row in range(0, shape[0], TILE)
            for column in range(0, shape[1], TILE)
        ]
        same = before is not None and before.origin == grid.origin
        if before is None or not same or before.cells.shape != grid.cells.shape:
            self.values = np.full(shape, -np.inf, np.float32)
            self.is_known = np.zeros(shape, np.bool_)
            self._waiting = tiles
            return
        self._waiting += [
            tile
            for tile in tiles
            if tile not in self._waiting
            and not np.array_equal(before.cells[_around(tile)], grid.cells[_around(tile)])
        ]

    def work(self, count: int) -> int:
        """Measure up to so many tiles; return how many are left."""
        assert self._grid is not None
        for _ in range(min(count, len(self._waiting))):
            tile = self._waiting.pop(0)
            cells = np.ascontiguousarray(self._grid.cells[_around(tile)])
            distances = measure_distances(cells >= self._occupied, self._grid.resolution)
            begin = [min(PLACE * at, _APRON) for at in tile]
            where = (slice(tile[0], tile[0] + TILE), slice(tile[1], tile[1] + TILE))
            known = cells != UNKNOWN
            pool(distances, known, (begin[0], begin[1]), self.values[where], self.is_known[where])
        return len(self._waiting)


# Obstacles beyond a tile are looked for as far away as room is told apart: at least so many cells.
_APRON = 12


def _around(tile: tuple[int, int]) -> tuple[slice, slice]:
    """Return the cells of a tile, and those that are near."""
    low = [max(PLACE * at - _APRON, 0) for at in tile]
    high = [PLACE * (at + TILE) + _APRON for at in tile]
    return slice(low[0], high[0]), slice(low[1], high[1])


@jit
def pool(
    distances: np.ndarray,
    known: np.ndarray,
    begin: tuple[int, int],
    rooms: np.ndarray,
    is_known: np.ndarray,
) -> None:
    """Write the most room of each place, and if it is known there, from the cell `begin` on."""
    rows, columns = distances.shape
    for row in range(rooms.shape[0]):
        for column in range(rooms.shape[1]):
            best, is_seen = -1.0, False
            for up in range(PLACE):
                for right in range(PLACE):
                    at_row = begin[0] + PLACE * row + up
                    at_column = begin[1] + PLACE * column + right
                    if at_row < rows and at_column < columns:
                        room = distances[at_row, at_column]
                        if room > best:
                            best, is_seen = room, known[at_row, at_column]
            rooms[row, column] = min(best, MOST_ROOM)
            is_known[row, column] = is_seen


class Overview:
    """
    The remaining cost to a goal (x, y, yaw) from each place of a whole map; in slices.

    `reach` [m] is the least distance of the robot's middle from obstacles. `values` are those of
    the places [m of free way]; what no way leads from has `beyond`.
    """

    def __init__(self, goal: np.ndarray, around: Surroundings, rooms: Rooms, reach: float) -> None:
        self._goal, self._around, self._rooms, self._reach = goal, around, rooms, reach
        rooms.take(around.whole, around.occupied)
        self._heap: Heap | None = None
        self._is_spread = self.is_done = False

    def work(self) -> bool:
        """
        Go on with it for one step; return whether it is done.

        Each part has a step of its own: so much comes before the first, and after the last.
        """
        if self.is_done or self._rooms.work(TILES):
            return self.is_done
        if self._heap is None:
            self._begin()
        elif not self._is_spread:
            values, resolution = self.values.values[0], self.values.resolution
            self._is_spread = march(values, self._heap, self._price, resolution, PLACES)
        else:
            self._end()
        return self.is_done

    def _end(self) -> None:
        values = self.values.values[0]
        reached = values < np.inf
        self.beyond = float(values[reached].max(initial=0.0)) + _BEYOND
        values[~reached] = self.beyond
        self.is_done = True

    def _begin(self) -> None:
        around, grid = self._around, self._around.whole
        rooms, is_known = self._rooms.values.copy(), self._rooms.is_known.copy()
        row, column = around.corner
        # What the live scan has added is in the part that is looked at well.
        seen = around.distances.values[0]
        here = tuple(
            slice(at // PLACE, -(-(at + size) // PLACE))
            for at, size in zip((row, column), seen.shape, strict=True)
        )
        pool(seen, ~around.is_unknown, (0, 0), rooms[here], is_known[here])
        comfort, dearer, unknown = around.prices
        lack = np.clip(1.0 - (rooms - self._reach) / comfort, 0.0, 1.0)
        price = 1.0 + dearer * lack * lack
        price[~is_known] += unknown
        self._price = np.where(rooms >= self._reach, price, np.inf).astype(np.float32)
        resolution = PLACE * grid.resolution
        x, y = (corner + 0.5 * resolution for corner in grid.origin)
        values = np.full(rooms.shape, np.inf, np.float32)
        self.values = Field(values[None], x, y, resolution)
        self._heap = make_heap(4 * values.size + 64)
        at = grid.to_cells(self._goal[None, :2])[0] // PLACE
        start_at(values, self._heap, self._price, (int(at[0]), int(at[1])), resolution)

    def at(self, points: np.ndarray) -> np.ndarray:
        """Return what is left from points, shape (n, 2) [m]; infinite where no way leads."""
        found = look_up_each(self.values, 0, np.ascontiguousarray(points))
        return np.where(found < self.beyond - 1.0, found, np.inf)

    def way_from(self, point: np.ndarray) -> np.ndarray:
        """Return places on the way from a point, shape (n, 2) [m]."""
        room = np.empty((_MOST_POINTS, 2))
        count = follow(self.values, 0, point, room)
        return room[:count]
