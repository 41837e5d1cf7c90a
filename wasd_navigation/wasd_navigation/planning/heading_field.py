# SPDX-License-Identifier: Apache-2.0
"""
How much way is left to the goal from each place and heading, for a footprint that is no circle.

Dijkstra's algorithm over places twice as far apart as the map's cells, and 16 headings: a robot
that is longer than a gap is wide finds out where it has to turn before it goes through.
"""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.planning.distance_field import Field
from wasd_navigation.planning.heap import Heap
from wasd_navigation.planning.heap import make_heap
from wasd_navigation.planning.heap import pop
from wasd_navigation.planning.heap import push
from wasd_navigation.planning.motion import Base
from wasd_navigation.planning.motion import clearance
from wasd_navigation.planning.surroundings import Surroundings

HEADINGS = 16
# So many cells of the map are one place each way.
COARSE = 2
# Steps to other places (rows, columns): by these directions ways are at most 2.7 % too long.
_STEPS = tuple(
    (up, right) for up in range(-2, 3) for right in range(-2, 3) if math.gcd(up, right) == 1
)
# Going backward is dearer than its time: a robot is made to look where it goes.
_BACKWARD = 1.5
# Where nobody may be: how deep, by the clearance there [m], and what a metre costs.
_DEEPEST, _ESCAPE_PRICE = 0.1, 20.0
# Beyond all that is reached [m].
_BEYOND = 10.0
# A way is good when all is known that is nearer to the goal than this times what is left from
# the robot, and this more [m]: it may go around.
_FARTHER, _AROUND = 1.2, 1.5
# A way has no more points than this, and so often each is moved to the mean of its neighbours.
_MOST_POINTS, _SMOOTHINGS = 4000, 3
# Turning is cheaper than its time: most of it is done under way.
_TURNING = 0.35


class Lattice(NamedTuple):
    """
    Places and headings with their values.

    `values` and `price`, shape (headings, rows, columns), float32: what is left [m of free way],
    and what a metre costs; infinite where nobody can be, negative where nobody may be, but from
    which one finds out, at so much: no way leads through. `moves`, shape
    (headings, m, 4): change of heading, row, column, and what it costs at a price of 1.
    """

    values: np.ndarray
    price: np.ndarray
    moves: np.ndarray
    heap: Heap


def make_moves(base: Base, length: float) -> np.ndarray:
    """Return the moves of a lattice whose places are `length` [m] apart, shape (16, m, 4)."""
    turn = 2.0 * math.pi / HEADINGS
    turning = _turn_price(base) * turn
    moves = []
    for heading in range(HEADINGS):
        own = [(1.0, 0.0, 0.0, turning), (-1.0, 0.0, 0.0, turning)]
        for up, right in _STEPS:
            # One comes from there, as what is left spreads from the goal: the other way round.
            bearing = math.atan2(-up, -right) - heading * turn
            own.append((0.0, up, right, length * math.hypot(up, right) * _dearness(base, bearing)))
        moves.append(own)
    return np.array(moves)


def _dearness(base: Base, bearing: float) -> float:
    """Return what a metre in a direction of the base frame costs, ahead being 1."""
    ahead, side = math.cos(bearing), math.sin(bearing)
    full = base.most[0] if ahead > 0.0 else -base.least[0]
    if ahead < -1e-9:
        ahead *= _BACKWARD
    if base.most[1] <= 0.0:
        return 1.0 / max(ahead, 0.05)
    return float(base.most[0] * math.hypot(ahead / full, side / base.most[1]))


@jit
def measure_room(distances: Field, circles: np.ndarray, enough: float) -> np.ndarray:
    """
    Return the clearance [m] of a footprint at all places and headings of a lattice.

    Shape (headings, rows, columns), float32; exact up to `enough`.
    """
    rows = (distances.values.shape[1] + COARSE - 1) // COARSE
    columns = (distances.values.shape[2] + COARSE - 1) // COARSE
    room = np.empty((HEADINGS, rows, columns), np.float32)
    state = np.zeros(3)
    for row in range(rows):
        state[1] = distances.y + row * COARSE * distances.resolution
        for column in range(columns):
            state[0] = distances.x + column * COARSE * distances.resolution
            # The other way round it covers the same.
            for heading in range(HEADINGS // 2):
                state[2] = heading * 2.0 * math.pi / HEADINGS
                here = clearance(distances, circles, state, enough)
                room[heading, row, column] = here
                room[heading + HEADINGS // 2, row, column] = here
    return room


class HeadingField:
    """What is left to a goal (x, y, yaw) for a robot that is long; drawn in slices."""

    def __init__(
        self,
        goal: np.ndarray,
        around: Surroundings,
        circles: np.ndarray,
        base: Base,
        margin: float,
    ) -> None:
        room = measure_room(around.distances, circles, margin + around.comfort)
        price = around.price_of(room - margin, COARSE)
        price[(room < margin) & (room > -_DEEPEST)] = -_ESCAPE_PRICE
        values = np.full(price.shape, np.inf, np.float32)
        self.values = around.field_of(values, COARSE)
        moves = make_moves(base, self.values.resolution)
        self._lattice = Lattice(values, price, moves, make_heap(8 * price.size))
        self._goal = goal
        _begin(self._lattice, goal, self.values, _turn_price(base))
        self.is_done = False
        self.beyond = 0.0

    def work(self, pose: np.ndarray, budget: int) -> bool:
        """Look at up to so many states; return whether the way from a pose is among them."""
        if self.is_done:
            return True
        heap = self._lattice.heap
        self.is_done = spread(self._lattice, budget)
        there = self._lattice.values[self._nearest(pose)]
        if not self.is_done and not heap.keys[0] > _FARTHER * there + _AROUND:
            return False
        drawn = self._lattice.values
        is_reached = drawn < np.inf
        self.beyond = (float(drawn[is_reached].max()) if is_reached.any() else 0.0) + _BEYOND
        values = np.where(is_reached, drawn, np.float32(self.beyond))
        self.values = self.values._replace(values=values)
        return True

    def _nearest(self, pose: np.ndarray) -> tuple[int, int, int]:
        """Return the state with the least value around a pose: heading, row, column."""
        headings, rows, columns = self._lattice.values.shape
        places = self.values
        column = (pose[0] - places.x) / places.resolution
        row = (pose[1] - places.y) / places.resolution
        heading = pose[2] / (2.0 * math.pi) * headings
        low, left = max(math.floor(row), 0), max(math.floor(column), 0)
        around = [(math.floor(heading) + turn) % headings for turn in (0, 1)]
        near = [
            (at, at_row, at_column)
            for at in around
            for at_row in range(min(low, rows - 2), min(low + 2, rows))
            for at_column in range(min(left, columns - 2), min(left + 2, columns))
        ]
        return min(near, key=lambda state: float(self._lattice.values[state]))

    def way_from(self, pose: np.ndarray) -> np.ndarray:
        """Return places and headings (x, y, yaw) on the way from a pose, shape (n, 3)."""
        states = np.empty((_MOST_POINTS, 3))
        places = self.values
        count = trace(self._lattice, self._nearest(pose), states)
        way = np.concatenate((pose[None], states[:count], self._goal[None]))
        way[1:-1, 0] = places.x + states[:count, 2] * places.resolution
        way[1:-1, 1] = places.y + states[:count, 1] * places.resolution
        way[1:-1, 2] = states[:count, 0] * 2.0 * math.pi / HEADINGS
        way[:, 2] = np.unwrap(way[:, 2])
        return _smoothed(way)


def _smoothed(way: np.ndarray) -> np.ndarray:
    """Return a way without the corners of the lattice: each point the mean of those around."""
    smooth = way.copy()
    for _ in range(_SMOOTHINGS):
        smooth[1:-1] = 0.25 * smooth[:-2] + 0.5 * smooth[1:-1] + 0.25 * smooth[2:]
    return smooth


def _turn_price(base: Base) -> float:
    """Return what turning costs [m/rad]."""
    return _TURNING / float(base.most[2]) * float(base.most[0])


def _begin(lattice: Lattice, goal: np.ndarray, places: Field, turning: float) -> None:
    """
    Give what is around a goal (x, y, yaw) its value, to spread from; `turning` is [m/rad].

    `places` is the field that the values will be.
    """
    headings, rows, columns = lattice.values.shape
    column = (goal[0] - places.x) / places.resolution
    row = (goal[1] - places.y) / places.resolution
    heading = goal[2] / (2.0 * math.pi) * headings
    for up in (0, 1):
        for right in (0, 1):
            for around in (0, 1):
                at_row, at_column = math.floor(row) + up, math.floor(column) + right
                at = (math.floor(heading) + around) % headings
                if not (0 <= at_row < rows and 0 <= at_column < columns):
                    continue
                if not 0.0 < lattice.price[at, at_row, at_column] < math.inf:
                    continue
                off = abs(math.floor(heading) + around - heading) * 2.0 * math.pi / headings
                away = math.hypot(at_row - row, at_column - column) * places.resolution
                value = away + turning * off
                lattice.values[at, at_row, at_column] = value
                push(lattice.heap, float(value), (at * rows + at_row) * columns + at_column)


@jit
def spread(lattice: Lattice, budget: int) -> bool:
    """Look at up to so many states, nearest first; return whether all are done."""
    values, price, moves = lattice.values, lattice.price, lattice.moves
    headings, rows, columns = values.shape
    while lattice.heap.held[0] > 0:
        if budget == 0:
            return False
        value, item = pop(lattice.heap)
        column = item % columns
        row = item // columns % rows
        heading = item // columns // rows
        if value > values[heading, row, column]:
            continue
        budget -= 1
        for move in range(moves.shape[1]):
            at = (heading + int(moves[heading, move, 0])) % headings
            at_row = row + int(moves[heading, move, 1])
            at_column = column + int(moves[heading, move, 2])
            if not (0 <= at_row < rows and 0 <= at_column < columns):
                continue
            if price[heading, row, column] < 0.0 < price[at, at_row, at_column]:
                continue
            # Both ends count: a step from a dear place into a cheap one is not cheap.
            mean = 0.5 * (abs(price[at, at_row, at_column]) + abs(price[heading, row, column]))
            new = float(np.float32(value + moves[heading, move, 3] * mean))
            if new < values[at, at_row, at_column]:
                values[at, at_row, at_column] = new
                push(lattice.heap, new, (at * rows + at_row) * columns + at_column)
    return True


@jit
def trace(lattice: Lattice, start: tuple[int, int, int], states: np.ndarray) -> int:
    """
    Write the states (heading, row, column) from one to the goal; return how many there are.

    Each is the one by which the one before it got its value.
    """
    values, price, moves = lattice.values, lattice.price, lattice.moves
    headings, rows, columns = values.shape
    heading, row, column = start
    count = 0
    while count < states.shape[0] and values[heading, row, column] < math.inf:
        states[count, 0], states[count, 1], states[count, 2] = heading, row, column
        count += 1
        best = values[heading, row, column]
        found = (-1, 0, 0)
        least = math.inf
        for move in range(moves.shape[1]):
            # A move is the same from all headings but for its price.
            at = (heading - int(moves[heading, move, 0])) % headings
            at_row = row - int(moves[heading, move, 1])
            at_column = column - int(moves[heading, move, 2])
            if not (0 <= at_row < rows and 0 <= at_column < columns):
                continue
            if values[at, at_row, at_column] >= best:
                continue
            mean = 0.5 * (abs(price[at, at_row, at_column]) + abs(price[heading, row, column]))
            total = values[at, at_row, at_column] + moves[heading, move, 3] * mean
            if total < least:
                least, found = total, (at, at_row, at_column)
        if found[0] < 0:
            break
        heading, row, column = found
    return count
