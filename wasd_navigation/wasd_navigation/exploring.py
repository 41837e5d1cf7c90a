# SPDX-License-Identifier: Apache-2.0
"""
Chooses goals for exploration: frontiers between known and unknown space.

Yamauchi, A frontier-based approach for autonomous exploration, 1997.
"""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.parameters import Footprint, PlanningParameters
from wasd_navigation.planning.distances import measure_distances
from wasd_navigation.planning.goal_field import ESCAPE_PRICE, ways_from
from wasd_navigation.planning.motion import HARD
from wasd_navigation.records import Grid, UNKNOWN
from wasd_navigation.se2 import wrap

# A frontier is no shorter than this [m]: what is shorter is a crack between two rays.
SHORTEST = 0.35
# Each metre of way must lead to so much unknown area behind a frontier [m^2]. What is left alone
# near by, as too short, is then not driven back to from far away.
PER_METRE = 0.03
# A frontier is seen when nothing is unknown so near to its middle [m].
NEAR = 0.3
# A metre of frontier is worth so many of way, up to so many; half a turn costs so many [m].
WORTH, LONGEST, TURNING = 0.5, 3.0, 0.7
# From a frontier that was driven to in vain others are so far away [m].
APART = 0.3
# So near to the robot the map is wrong rather than the robot, where no robot could stand [m].
ESCAPE = 1.0
# The way to the first frontier of a tour counts so many times: what is near comes first, for the
# unknown may change all that comes later.
FIRST = 2.0
# A tour leads to so many frontiers, those with the least cost; its legs are measured in places of
# so many cells, and one where no way leads is so long [m].
MOST, PLACE, FAR = 9, 3, 100.0


class Choice(NamedTuple):
    """A frontier: what the way there costs [m], its viewpoint's cell, its middle [m]."""

    cost: float
    cell: np.ndarray
    middle: np.ndarray


class Explorer:
    """
    Chooses goals until no frontier that the robot can reach is worth the way.

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
        self,
        grid: Grid,
        pose: np.ndarray,
        beyond: np.ndarray | None = None,
        home: np.ndarray | None = None,
    ) -> np.ndarray | None:
        """
        Return the next goal (x, y, yaw) for a robot at a pose, shape (3,); None: all is seen.

        Its yaw is NaN: that of the way there. It is the first on a short tour of the frontiers
        that ends at `home` (x, y, ...), or at any of them. With a place `beyond`, shape (2,), it
        is one from which a way through the unknown may lead there; the shortest first.
        """
        distances = self._distances(grid)
        price = self._price(grid, distances, pose)
        rest = None if beyond is None else self._rest(grid, distances, beyond)
        choices = self._choices(grid, distances, price, pose, rest)
        choices = sorted(choices, key=lambda choice: choice.cost)[:MOST]
        if not choices:
            self.aim = None
            return None
        first = 0
        if rest is None:
            ends = [choice.cell for choice in choices]
            if home is not None:
                ends.append(grid.to_cells(home[None, :2])[0])
            legs = measure_legs(price, np.array(ends), grid.resolution)
            first = begin_tour(FIRST * np.array([choice.cost for choice in choices]), legs)
        self.aim = choices[first].middle
        return np.append(grid.to_points(choices[first].cell[None])[0], math.nan)

    def _choices(
        self,
        grid: Grid,
        distances: np.ndarray,
        price: np.ndarray,
        pose: np.ndarray,
        rest: np.ndarray | None,
    ) -> list[Choice]:
        """Return the frontiers that are worth the way; with a `rest` of it beyond them, all."""
        ways = ways_from(grid.to_cells(pose[None, :2])[0], price, grid.resolution)
        choices = []
        for cells, behind in self._frontiers(grid, distances):
            middle = grid.to_points(cells.mean(axis=0)[None].round().astype(int))[0]
            if any(math.dist(middle, place) < APART for place in self._in_vain):
                continue
            cell = self._viewpoint(ways, cells)
            if cell is None:
                continue
            way = float(ways[tuple(cell)])
            turn = wrap(math.atan2(*(grid.to_points(cell[None])[0] - pose[:2])[::-1]) - pose[2])
            cost = way + TURNING * abs(turn) / math.pi
            if rest is not None:
                cost += float(rest[tuple(cells.T)].min())
            elif behind * grid.resolution**2 >= PER_METRE * way:
                cost -= WORTH * min(len(cells) * grid.resolution, LONGEST)
            else:
                continue
            if cost < math.inf:
                choices.append(Choice(cost, cell, middle))
        return choices

    def forget(self) -> None:
        """Begin again: no frontier was driven to in vain."""
        self._in_vain, self.aim = [], None

    def is_seen(self, grid: Grid, pose: np.ndarray) -> bool:
        """Whether the frontier it drives to has been seen, or is shut off from a pose."""
        if self.aim is None:
            return True
        distances = self._distances(grid)
        aim = grid.to_cells(self.aim[None])[0]
        left = [
            cells
            for cells, _ in self._frontiers(grid, distances)
            if (np.hypot(*(cells - aim).T) * grid.resolution < NEAR).any()
        ]
        if not left:
            return True
        price = self._price(grid, distances, pose)
        ways = ways_from(grid.to_cells(pose[None, :2])[0], price, grid.resolution)
        return all(self._viewpoint(ways, cells) is None for cells in left)

    def give_up(self) -> None:
        """Drive to the present frontier no more."""
        if self.aim is not None:
            self._in_vain.append(self.aim)
            self.aim = None

    def _distances(self, grid: Grid) -> np.ndarray:
        distances: np.ndarray = measure_distances(grid.cells >= self._occupied, grid.resolution)
        return distances

    def _frontiers(self, grid: Grid, distances: np.ndarray) -> list[tuple[np.ndarray, int]]:
        return frontiers(grid.cells, distances, self._reach, round(SHORTEST / grid.resolution))

    def _price(self, grid: Grid, distances: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """
        Return what a metre costs in each cell: 1 in what is known to be free, infinite elsewhere.

        Out of where the robot stands and no robot may, ways lead, but cost more.
        """
        known = np.where(grid.cells == UNKNOWN, np.float32(-1.0), distances)
        price = np.where(known >= self._reach, np.float32(1.0), np.float32(np.inf))
        size = round(ESCAPE / grid.resolution)
        row, column = grid.to_cells(pose[None, :2])[0]
        near = tuple(slice(max(at - size, 0), at + size + 1) for at in (row, column))
        is_tight = (known[near] < self._reach) & (known[near] > 0.5 * self._reach)
        price[near][is_tight] = ESCAPE_PRICE
        return price

    def _rest(self, grid: Grid, distances: np.ndarray, beyond: np.ndarray) -> np.ndarray:
        """Return how far it is at least from each cell to a place [m], known or not."""
        price = np.where(distances >= self._reach, 1.0, np.inf).astype(np.float32)
        return ways_from(grid.to_cells(beyond[None])[0], price, grid.resolution)

    def _viewpoint(self, ways: np.ndarray, cells: np.ndarray) -> np.ndarray | None:
        """Return the cell nearest to a frontier's middle that can be driven to, if any can."""
        reached = cells[np.isfinite(ways[tuple(cells.T)])]
        if not len(reached):
            return None
        apart = np.hypot(*(reached - cells.mean(axis=0)).T)
        return np.asarray(reached[int(apart.argmin())])


def measure_legs(price: np.ndarray, cells: np.ndarray, resolution: float) -> np.ndarray:
    """
    Return about how far it is between cells (row, column), shape (n, 2) [m], shape (n, n).

    `price` is as `ways_from` has it; FAR where no way leads.
    """
    rows, columns = (size // PLACE for size in price.shape)
    used = price[: rows * PLACE, : columns * PLACE]
    best = used.reshape(rows, PLACE, columns, PLACE).min(axis=(1, 3))
    places = np.clip(cells // PLACE, 0, (rows - 1, columns - 1))
    best[tuple(places.T)] = 1.0
    ways = [ways_from(place, best, PLACE * resolution)[tuple(places.T)] for place in places]
    legs: np.ndarray = np.minimum(np.array(ways, float), FAR)
    return legs


def begin_tour(begins: np.ndarray, legs: np.ndarray) -> int:
    """
    Return the first place of the shortest tour of n places.

    `begins`, shape (n,), are the ways to each, `legs`, shape (n, n), those between them, or
    shape (n + 1, n + 1) with those to where it ends (Held and Karp, A dynamic programming approach
    to sequencing problems, 1962).
    """
    count = len(begins)
    places, bits = np.arange(count), 1 << np.arange(count)
    # What is left from each place on when those whose bits are set are still to come.
    left = np.zeros((1 << count, count))
    if len(legs) > count:
        left[0] = legs[:count, count]
    for coming in range(1, 1 << count):
        to = places[(coming & bits) > 0]
        left[coming] = (legs[:count, to] + left[coming - bits[to], to]).min(axis=1)
    return int((begins + left[left.shape[0] - 1 - bits, places]).argmin())


def frontiers(
    cells: np.ndarray, distances: np.ndarray, reach: float, least: int
) -> list[tuple[np.ndarray, int]]:
    """
    Return the cells (row, column), shape (n, 2), of each frontier of at least so many.

    With each comes how many cells behind it are unknown. Only what a disc could drive across is
    one: `distances` [m] are to the walls that are known, `reach` is what its middle keeps from
    them.
    """
    has_room = distances >= reach
    is_unknown = cells == UNKNOWN
    parts = np.zeros(cells.shape, np.int32)
    _label(has_room & is_unknown, parts)
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0
    behind = _most_near(sizes[parts]) * (has_room & ~is_unknown)
    labels = np.zeros(cells.shape, np.int32)
    count = _label(behind > 0, labels)
    places = np.argwhere(labels > 0)
    number = labels[tuple(places.T)]
    order = np.argsort(number, kind='stable')
    if not count:
        return []
    found = np.split(places[order], np.flatnonzero(np.diff(number[order])) + 1)
    return [(part, int(behind[tuple(part.T)].max())) for part in found if len(part) >= least]


def _most_near(values: np.ndarray) -> np.ndarray:
    """Return the most that any of the four neighbours of each cell has."""
    most = np.zeros_like(values)
    for to, of in ((np.s_[1:], np.s_[:-1]), (np.s_[:-1], np.s_[1:])):
        most[to] = np.maximum(most[to], values[of])
        most[:, to] = np.maximum(most[:, to], values[:, of])
    return most


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
