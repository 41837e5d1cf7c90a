# SPDX-License-Identifier: Apache-2.0
"""
Chooses goals for exploration: frontiers between known and unknown space.

Yamauchi, A frontier-based approach for autonomous exploration, 1997.
"""

import math

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.parameters import Footprint, PlanningParameters
from wasd_navigation.planning.distances import measure_distances
from wasd_navigation.planning.goal_field import (
    flood,
    make_heap,
    march,
    march_from,
    start_at,
    WHOLE,
)
from wasd_navigation.planning.motion import HARD
from wasd_navigation.records import Grid, UNKNOWN
from wasd_navigation.se2 import wrap

# A frontier is no shorter than this [m]: what is shorter is a crack between two rays.
SHORTEST = 0.35
# A frontier is seen when nothing is unknown so near to its middle [m].
NEAR = 0.3
# A metre of frontier is worth so many of way, a turn of half a circle costs so many [m].
WORTH, TURNING = 0.5, 0.7
# From a frontier that was driven to in vain others are so far away [m].
APART = 0.3


class Explorer:
    """
    Chooses goals until the robot can reach no more frontiers.

    `aim` is the middle of the frontier that it drives to, shape (2,) [m], None where it drives to
    none.
    """

    def __init__(self, footprint: Footprint, parameters: PlanningParameters) -> None:
        self._reach = footprint.inscribed + HARD * parameters.margin
        if not footprint.is_circle:
            # Where a long robot could turn it is no matter which way it comes.
            self._reach += parameters.margin
        self._occupied = parameters.occupied
        self._in_vain: list[np.ndarray] = []
        self.aim: np.ndarray | None = None

    def choose(
        self, grid: Grid, pose: np.ndarray, beyond: np.ndarray | None = None
    ) -> np.ndarray | None:
        """
        Return the next goal (x, y, yaw) for a robot at a pose, shape (3,); None: all is seen.

        Its yaw is NaN: that of the way there. With a place `beyond`, shape (2,), it is one from
        which a way through the unknown may lead there; the shortest first.
        """
        is_wall, is_unknown = grid.cells >= self._occupied, grid.cells == UNKNOWN
        distances = measure_distances(is_wall, grid.resolution)
        ways = self._ways(grid, distances, is_unknown, pose)
        rest = None if beyond is None else self._rest(grid, distances, beyond)
        best, goal = math.inf, None
        self.aim = None
        least = round(SHORTEST / grid.resolution)
        for cells in frontiers(grid.cells, distances, self._reach, least):
            middle = grid.to_points(cells.mean(axis=0)[None].round().astype(int))[0]
            if any(math.dist(middle, place) < APART for place in self._in_vain):
                continue
            found = self._viewpoint(ways, cells)
            if found is None:
                continue
            place = grid.to_points(found[None])[0]
            turn = abs(wrap(math.atan2(*(place - pose[:2])[::-1]) - pose[2]))
            cost = float(ways[tuple(found)]) + TURNING * turn / math.pi
            if rest is None:
                cost -= WORTH * min(len(cells) * grid.resolution, 3.0)
            else:
                cost += float(rest[tuple(cells.T)].min())
            if cost < best:
                best, goal, self.aim = cost, np.append(place, math.nan), middle
        return goal

    def forget(self) -> None:
        """Begin again: no frontier was driven to in vain."""
        self._in_vain, self.aim = [], None

    def is_seen(self, grid: Grid) -> bool:
        """Whether the frontier that is driven to is none any more."""
        if self.aim is None:
            return True
        is_wall = grid.cells >= self._occupied
        distances = measure_distances(is_wall, grid.resolution)
        aim = grid.to_cells(self.aim[None])[0]
        return not any(
            bool((np.hypot(*(cells - aim).T) * grid.resolution < NEAR).any())
            for cells in frontiers(grid.cells, distances, self._reach, 1)
        )

    def give_up(self) -> None:
        """Drive to the present frontier no more."""
        if self.aim is not None:
            self._in_vain.append(self.aim)
            self.aim = None

    def _ways(
        self, grid: Grid, distances: np.ndarray, is_unknown: np.ndarray, pose: np.ndarray
    ) -> np.ndarray:
        """Return how far it is to each cell [m], through what is known to be free."""
        start = grid.to_cells(pose[None, :2])[0]
        known = np.where(is_unknown, np.float32(-1.0), distances)
        price = np.where(known >= self._reach, 1.0, np.inf).astype(np.float32)
        values = np.full(price.shape, np.inf, np.float32)
        heap = make_heap(4 * values.size + 64)
        begin = (int(start[0]), int(start[1]))
        start_at(values, heap, price, begin, grid.resolution)
        march(values, heap, price, grid.resolution, WHOLE)
        if not np.isfinite(values).any():  # it stands where it may not
            seen = flood(start, known, 0.5 * self._reach)
            values[seen] = 1.0
        return values

    def _rest(self, grid: Grid, distances: np.ndarray, beyond: np.ndarray) -> np.ndarray:
        """Return how far it is at least from each cell to a place [m], known or not."""
        price = np.where(distances >= self._reach, 1.0, np.inf).astype(np.float32)
        row, column = map(int, grid.to_cells(beyond[None])[0])
        values, most = march_from(
            (row, column), price, np.zeros(price.shape, bool), grid.resolution
        )
        return np.where(values < most, values, np.inf)

    def _viewpoint(self, ways: np.ndarray, cells: np.ndarray) -> np.ndarray | None:
        """Return the cell nearest to a frontier's middle that can be driven to, if any can."""
        reached = cells[np.isfinite(ways[tuple(cells.T)])]
        if not len(reached):
            return None
        apart = np.hypot(*(reached - cells.mean(axis=0)).T)
        return np.asarray(reached[int(apart.argmin())])


def frontiers(
    cells: np.ndarray, distances: np.ndarray, reach: float, least: int
) -> list[np.ndarray]:
    """
    Return the cells (row, column), shape (n, 2), of each frontier of at least so many.

    Only what a disc could drive across is one: `distances` [m] are to the walls that are known,
    `reach` is what its middle keeps from them.
    """
    edge = _edge(cells, distances, reach)
    labels = np.zeros(cells.shape, np.int32)
    count = _label(edge, labels)
    places = np.argwhere(labels > 0)
    number = labels[tuple(places.T)]
    order = np.argsort(number, kind='stable')
    parts = np.split(places[order], np.flatnonzero(np.diff(number[order])) + 1) if count else []
    return [part for part in parts if len(part) >= least]


@jit
def _edge(cells: np.ndarray, distances: np.ndarray, reach: float) -> np.ndarray:
    """Return which known cells have an unknown neighbour, both far enough from walls."""
    rows, columns = cells.shape
    edge = np.zeros((rows, columns), np.bool_)
    for row in range(1, rows - 1):
        for column in range(1, columns - 1):
            if cells[row, column] < 0 or distances[row, column] < reach:
                continue
            for turn in range(4):
                at_row = row + (turn == 0) - (turn == 1)
                at_column = column + (turn == 2) - (turn == 3)
                if cells[at_row, at_column] < 0 and distances[at_row, at_column] >= reach:
                    edge[row, column] = True
    return edge


@jit
def _label(edge: np.ndarray, labels: np.ndarray) -> int:
    """Number the connected parts of an edge, by all eight neighbours, from 1; return how many."""
    rows, columns = edge.shape
    waiting = np.empty(rows * columns, np.int32)
    count = 0
    for start in range(rows * columns):
        row, column = start // columns, start % columns
        if not edge[row, column] or labels[row, column] > 0:
            continue
        count += 1
        labels[row, column] = count
        waiting[0] = start
        held = 1
        while held > 0:
            held -= 1
            row, column = waiting[held] // columns, waiting[held] % columns
            for up in range(-1, 2):
                for right in range(-1, 2):
                    to_row, to_column = row + up, column + right
                    if not (0 <= to_row < rows and 0 <= to_column < columns):
                        continue
                    if edge[to_row, to_column] and labels[to_row, to_column] == 0:
                        labels[to_row, to_column] = count
                        waiting[held] = to_row * columns + to_column
                        held += 1
    return count
