# SPDX-License-Identifier: Apache-2.0
"""
The remaining cost to the goal from each place and heading, for a long footprint.

Dijkstra's algorithm over places twice as far apart as the map's cells, and 16 headings: a robot
that is longer than a gap is wide finds out where it has to turn before it goes through.
"""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.planning.distances import Field
from wasd_navigation.planning.goal_field import Heap, make_heap, pop, push
from wasd_navigation.planning.motion import Base
from wasd_navigation.planning.surroundings import Surroundings

HEADINGS = 16  # a power of 2
# So many cells of the map are one place each way.
COARSE = 2
# Steps to other places (rows, columns): by these directions ways are at most 2.7 % too long.
_STEPS = tuple(
    (up, right) for up in range(-2, 3) for right in range(-2, 3) if math.gcd(up, right) == 1
)
# Going backward is dearer than its time: a robot is made to look where it goes.
_BACKWARD = 1.5
# Where nobody may be: how deep, by the clearance there [m], and what a metre costs. One finds out
# in so many steps, or not: along a wall there is no end of such states, through closed doors too.
_DEEPEST, _ESCAPE_PRICE, _MOST_ESCAPES = 0.1, 20.0, 4
# Beyond all that is reached [m].
_BEYOND = 10.0
# A way is good when all is known that is nearer to the goal than what is left from the robot and
# this [m]: it may go around. What is farther is drawn while it drives.
_AROUND = 1.5
# A place's prices take as long as so many states; so do so many looks at the room near a pose.
_PRICED, _LOOKS = 4, 3
# A way has no more points than this, and so often each is moved to the mean of its neighbours.
_MOST_POINTS, _SMOOTHINGS = 4000, 3


# In a gap a place stands for the pose near it that has most room: up to so many of these to the
# left [m], and of the heading [rad], each found in steps half as large as the last.
_SHIFTS, _MOST_SHIFT = (0.0125, math.pi / HEADINGS / 8.0), 4


class Taste(NamedTuple):
    """Preferences of a path: `comfort` is the share of the wanted clearance."""

    comfort: float
    turning: float  # what a turn costs, as a share of its time: most of it is done under way
    is_even: bool  # a metre costs the same whichever way the robot looks


EASY, SHORT = Taste(1.0, 0.35, False), Taste(0.5, 0.05, True)


class Prices(NamedTuple):
    """The price of a place: the wanted clearance, and the cost of less."""

    least: float  # what every pose must have [m]
    margin: float  # [m]
    comfort: float  # [m]
    lack: float  # what a metre costs more without any comfort
    unseen: float  # extra cost of a metre on unseen ground


class Covers(NamedTuple):
    """
    The circles of a footprint at each heading of the first half turn, in a grid's cells.

    `cells`, shape (headings / 2, n, 2): rows and columns from the footprint's middle to the lowest
    of the four cells around a circle's middle; `shares`, shape (headings / 2, n, 4): what each of
    them counts there, by rows; `radii`, shape (n,) [m]; `reach`: from the footprint's middle to
    the end of the farthest circle [m]; and what they were made from.
    """

    cells: np.ndarray
    shares: np.ndarray
    radii: np.ndarray
    reach: float
    circles: np.ndarray
    resolution: float


class Terrain(NamedTuple):
    """What prices come from: `distances` [m] of all cells, `is_unseen`, bool, of the places."""

    distances: np.ndarray
    is_unseen: np.ndarray
    covers: Covers
    prices: Prices


class Lattice(NamedTuple):
    """
    Places and headings with their values.

    `values` and `price`, shape (headings, rows, columns), float32: what is left [m of free way],
    and what a metre costs. Values are NaN until they are computed, infinite where the robot cannot
    be, negative where it may only leave, at so much: no way leads through. `escapes`,
    uint8, the same shape: steps that lead out from there. `shifts`, int8, shape (headings / 2,
    rows, columns, 2): how far to the left of the place and of the heading the pose is that it
    stands for, in _SHIFTS. `moves`, shape (m, 3): change of heading, row, column. `costs`, shape
    (headings, m): what each costs at a price of 1.
    """

    values: np.ndarray
    price: np.ndarray
    escapes: np.ndarray
    shifts: np.ndarray
    moves: np.ndarray
    costs: np.ndarray
    heap: Heap
    terrain: Terrain


def make_moves(base: Base, length: float, taste: Taste) -> tuple[np.ndarray, np.ndarray]:
    """Return moves and costs of a lattice whose places are `length` [m] apart; see Lattice."""
    turn = 2.0 * math.pi / HEADINGS
    moves = np.array([(1, 0, 0), (-1, 0, 0), *((0, up, right) for up, right in _STEPS)])
    ups, rights = moves[2:, 1], moves[2:, 2]
    # One comes from there, as what is left spreads from the goal: the other way round.
    bearings = np.arctan2(-ups, -rights) - turn * np.arange(HEADINGS)[:, None]
    costs = np.full((HEADINGS, len(moves)), _turn_price(base, taste) * turn)
    dearness = 1.0 if taste.is_even else _dearness(base, bearings)
    costs[:, 2:] = length * np.hypot(ups, rights) * dearness
    return moves, costs


def _dearness(base: Base, bearings: np.ndarray) -> np.ndarray:
    """Return what a metre in directions of the base frame costs, ahead being 1."""
    ahead, side = np.cos(bearings), np.sin(bearings)
    full = np.where(ahead > 0.0, base.most[0], -base.least[0])
    ahead = np.where(ahead < -1e-9, ahead * _BACKWARD, ahead)
    if base.most[1] <= 0.0:
        return np.asarray(1.0 / ahead.clip(0.05))
    return np.asarray(base.most[0] * np.hypot(ahead / full, side / base.most[1]))


def cover(circles: np.ndarray, resolution: float) -> Covers:
    """Return circles (x, y, radius) [m]; the other way round a footprint covers the same."""
    angles = 2.0 * math.pi / HEADINGS * np.arange(HEADINGS // 2)[:, None]
    cos, sin = np.cos(angles), np.sin(angles)
    x, y, radii = circles.T
    places = np.stack((sin * x + cos * y, cos * x - sin * y), axis=-1) / resolution
    cells = np.floor(places)
    above, right = np.moveaxis(places - cells, -1, 0)
    shares = (
        (1.0 - above) * (1.0 - right), (1.0 - above) * right, above * (1.0 - right), above * right
    )  # fmt: skip
    reach = float((np.hypot(x, y) + radii).max())
    shared = np.stack(shares, axis=-1)
    whole = np.ascontiguousarray(circles)
    return Covers(cells.astype(np.int64), shared, radii.copy(), reach, whole, resolution)


@jit
def set_price(lattice: Lattice, row: int, column: int) -> int:
    """Give a place its prices; return how many states could be looked at meanwhile."""
    distances, is_unseen, covers, prices = lattice.terrain
    cell = COARSE * row, COARSE * column
    enough = prices.margin + prices.comfort + covers.reach
    more = prices.unseen * is_unseen[row, column]
    is_free = distances[cell] >= enough
    # No pose near the place has so much more room than it.
    most = _MOST_SHIFT * (_SHIFTS[0] + _SHIFTS[1] * covers.reach)
    shift = np.zeros(2, np.int64)
    looks = 0
    for heading in range(HEADINGS // 2):
        price = 1.0
        if not is_free:
            room = _room(distances, covers, cell, heading)
            if max(-_DEEPEST, prices.least - most) < room < prices.least:
                room, looked = _shift_in_gap(distances, covers, cell, heading, prices.least, shift)
                looks += looked
                lattice.shifts[heading, row, column, 0] = shift[0]
                lattice.shifts[heading, row, column, 1] = shift[1]
            lack = min(max(1.0 - (room - prices.margin) / prices.comfort, 0.0), 1.0)
            price += prices.lack * lack * lack
            if room < prices.least:
                price = -_ESCAPE_PRICE if room > -_DEEPEST else math.inf
        price += more if price > 0.0 else 0.0
        for at in (heading, heading + HEADINGS // 2):
            lattice.price[at, row, column] = price
    return _PRICED + looks // _LOOKS


@jit
def _room(distances: np.ndarray, covers: Covers, cell: tuple[int, int], heading: int) -> float:
    """Return the clearance [m] of a footprint whose middle is a cell's."""
    most_row, most_column = distances.shape[0] - 2, distances.shape[1] - 2
    least = float(distances[cell])
    for index in range(covers.radii.shape[0]):
        row = min(max(cell[0] + covers.cells[heading, index, 0], 0), most_row)
        column = min(max(cell[1] + covers.cells[heading, index, 1], 0), most_column)
        shares = covers.shares[heading, index]
        there = shares[0] * distances[row, column] + shares[1] * distances[row, column + 1]
        there += shares[2] * distances[row + 1, column]
        there += shares[3] * distances[row + 1, column + 1]
        least = min(least, there - covers.radii[index])
    return least


@jit
def _shift_in_gap(
    distances: np.ndarray,
    covers: Covers,
    cell: tuple[int, int],
    heading: int,
    least: float,
    shift: np.ndarray,
) -> tuple[float, int]:
    """
    Return the most room [m] of a pose near a place, and how often it has looked for it.

    It writes the pose's `shift` to the left and turn. Only in a gap: where there is room beside
    it, the place there will do.
    """
    shift[0] = shift[1] = 0
    looks = 3
    best = _room_near(distances, covers, cell, heading, 0, 0)
    for side in (-2 * _MOST_SHIFT, 2 * _MOST_SHIFT):
        if _room_near(distances, covers, cell, heading, side, 0) >= least:
            return best, looks
    step = _MOST_SHIFT
    while step > 0:
        is_better = True
        while is_better:
            is_better = False
            for kind in range(4):
                left = shift[0] + (step if kind == 0 else -step if kind == 1 else 0)
                turn = shift[1] + (step if kind == 2 else -step if kind == 3 else 0)
                if max(abs(left), abs(turn)) > _MOST_SHIFT:
                    continue
                room = _room_near(distances, covers, cell, heading, left, turn)
                looks += 1
                if room > best + 1e-6:
                    best, is_better = room, True
                    shift[0], shift[1] = left, turn
        step //= 2
    return best, looks


@jit
def _room_near(
    distances: np.ndarray,
    covers: Covers,
    cell: tuple[int, int],
    heading: int,
    left: int,
    turn: int,
) -> float:
    """Return the clearance [m] of a footprint that is shifted off a cell's middle."""
    most_row, most_column = distances.shape[0] - 1.001, distances.shape[1] - 1.001
    yaw = 2.0 * math.pi / HEADINGS * heading
    aside = left * _SHIFTS[0] / covers.resolution
    up, right = cell[0] + math.cos(yaw) * aside, cell[1] - math.sin(yaw) * aside
    yaw += turn * _SHIFTS[1]
    cos, sin = math.cos(yaw) / covers.resolution, math.sin(yaw) / covers.resolution
    least = math.inf
    for index in range(covers.radii.shape[0]):
        x, y = covers.circles[index, 0], covers.circles[index, 1]
        row = min(max(up + sin * x + cos * y, 0.0), most_row)
        column = min(max(right + cos * x - sin * y, 0.0), most_column)
        low, first = int(row), int(column)
        above, across = row - low, column - first
        there = (1.0 - above) * (1.0 - across) * distances[low, first]
        there += (1.0 - above) * across * distances[low, first + 1]
        there += above * (1.0 - across) * distances[low + 1, first]
        there += above * across * distances[low + 1, first + 1]
        least = min(least, there - covers.radii[index])
    return least


class HeadingField:
    """
    The remaining cost to a goal (x, y, yaw) for a long robot; computed in slices.

    `margins` are what every pose must have, and from which on room is dear [m].
    """

    def __init__(
        self,
        goal: np.ndarray,
        around: Surroundings,
        circles: np.ndarray,
        base: Base,
        margins: tuple[float, float],
        taste: Taste = EASY,
        border: np.ndarray | None = None,
    ) -> None:
        is_unseen = around.is_unseen[::COARSE, ::COARSE]
        comfort, lack, unseen = around.prices
        terrain = Terrain(
            around.distances.values[0],  # what is around may be another by the time all is drawn
            is_unseen,
            cover(circles, around.distances.resolution),
            Prices(*margins, taste.comfort * comfort, lack, unseen),
        )
        shape = (HEADINGS, *is_unseen.shape)
        values, price = (np.full(shape, fill, np.float32) for fill in (np.inf, np.nan))
        self.values = around.field_of(values, COARSE)
        moves, costs = make_moves(base, self.values.resolution, taste)
        escapes = np.zeros(shape, np.uint8)
        shifts = np.zeros((HEADINGS // 2, *shape[1:], 2), np.int8)
        heap = make_heap(8 * price.size)
        self._lattice = Lattice(values, price, escapes, shifts, moves, costs, heap, terrain)
        self.is_done = False
        self.beyond = 0.0
        self._goal = goal
        _begin(self._lattice, goal, self.values, _turn_price(base, taste))
        if border is not None:
            _begin_along(self._lattice, np.ascontiguousarray(border[::COARSE, ::COARSE]))

    def work(self, pose: np.ndarray, budget: int) -> bool:
        """Look at up to so many states; return whether the way from a pose is among them."""
        if self.is_done:
            return True
        if budget <= 0:
            return False
        heap = self._lattice.heap
        self.is_done = spread(self._lattice, budget)
        there = self._lattice.values[self._nearest(pose)]
        if not self.is_done and not heap.keys[0] > there + _AROUND:
            return False
        shown = np.empty_like(self._lattice.values)
        self.beyond = show(self._lattice.values, shown)
        self.values = self.values._replace(values=shown)
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
        at = states[:count].astype(int)
        shifts = self._lattice.shifts[at[:, 0] % (HEADINGS // 2), at[:, 1], at[:, 2]] * _SHIFTS
        # A half turn on, what was to the left is to the right.
        side = np.where(at[:, 0] < HEADINGS // 2, 1.0, -1.0) * shifts[:, 0]
        way[1:-1, 0] -= np.sin(way[1:-1, 2]) * side
        way[1:-1, 1] += np.cos(way[1:-1, 2]) * side
        way[1:-1, 2] += shifts[:, 1]
        way[:, 2] = np.unwrap(way[:, 2])
        return _smoothed(way)


def _smoothed(way: np.ndarray) -> np.ndarray:
    """Return a way without the corners of the lattice: each point the mean of those around."""
    smooth = way.copy()
    for _ in range(_SMOOTHINGS):
        smooth[1:-1] = 0.25 * smooth[:-2] + 0.5 * smooth[1:-1] + 0.25 * smooth[2:]
    return smooth


def _turn_price(base: Base, taste: Taste) -> float:
    """Return what turning costs [m/rad]."""
    return taste.turning / float(base.most[2]) * float(base.most[0])


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
                if math.isnan(lattice.price[at, at_row, at_column]):
                    set_price(lattice, at_row, at_column)
                if not 0.0 < lattice.price[at, at_row, at_column] < math.inf:
                    continue
                off = abs(math.floor(heading) + around - heading) * 2.0 * math.pi / headings
                away = math.hypot(at_row - row, at_column - column) * places.resolution
                value = away + turning * off
                lattice.values[at, at_row, at_column] = value
                push(lattice.heap, float(value), (at * rows + at_row) * columns + at_column)


@jit
def _begin_along(lattice: Lattice, border: np.ndarray) -> None:
    """Begin at places from which it is known what is left, whichever way the robot looks."""
    headings, rows, columns = lattice.values.shape
    for row in range(rows):
        for column in range(columns):
            if not border[row, column] < math.inf:
                continue
            set_price(lattice, row, column)
            for heading in range(headings):
                price = lattice.price[heading, row, column]
                is_less = border[row, column] < lattice.values[heading, row, column]
                if 0.0 < price < math.inf and is_less:
                    lattice.values[heading, row, column] = border[row, column]
                    item = (heading * rows + row) * columns + column
                    push(lattice.heap, float(border[row, column]), item)


@jit
def spread(lattice: Lattice, budget: int) -> bool:
    """
    Look at up to so many states, nearest first; return whether all are done.

    Places that it comes to get their prices, which count as the states that they take as long as.
    """
    values, price, moves, costs = lattice.values, lattice.price, lattice.moves, lattice.costs
    _, rows, columns = values.shape
    while lattice.heap.held[0] > 0:
        if budget <= 0:
            return False
        value, item = pop(lattice.heap)
        column = item % columns
        row = item // columns % rows
        heading = item // columns // rows
        if value > values[heading, row, column]:
            continue
        budget -= 1
        here = price[heading, row, column]
        for move in range(moves.shape[0]):
            at_row, at_column = row + moves[move, 1], column + moves[move, 2]
            if not (0 <= at_row < rows and 0 <= at_column < columns):
                continue
            at = (heading + moves[move, 0]) & (HEADINGS - 1)
            # Most of what is around is nearer to the goal, or an obstacle.
            if values[at, at_row, at_column] <= value:
                continue
            if math.isnan(price[at, at_row, at_column]):
                budget -= set_price(lattice, at_row, at_column)
            there = price[at, at_row, at_column]
            if there == math.inf or here < 0.0 < there:
                continue
            out = lattice.escapes[heading, row, column] + 1 if there < 0.0 else 0
            if out > _MOST_ESCAPES:
                continue
            # Both ends count: a step from a dear place into a cheap one is not cheap.
            mean = 0.5 * (abs(there) + abs(here))
            new = float(np.float32(value + costs[heading, move] * mean))
            if new < values[at, at_row, at_column]:
                values[at, at_row, at_column] = new
                lattice.escapes[at, at_row, at_column] = out
                push(lattice.heap, new, (at * rows + at_row) * columns + at_column)
    return True


@jit
def show(values: np.ndarray, shown: np.ndarray) -> float:
    """Write values to `shown`, the infinite ones as what is beyond all others; return that [m]."""
    most = 0.0
    for value in values.flat:
        if most < value < math.inf:
            most = value
    beyond = most + _BEYOND
    flat = shown.ravel()
    for index, value in enumerate(values.flat):
        flat[index] = min(value, beyond)
    return beyond


@jit
def trace(lattice: Lattice, start: tuple[int, int, int], states: np.ndarray) -> int:
    """
    Write the states (heading, row, column) from one to the goal; return how many there are.

    Each is the one by which the one before it got its value.
    """
    values, price, moves, costs = lattice.values, lattice.price, lattice.moves, lattice.costs
    headings, rows, columns = values.shape
    heading, row, column = start
    count = 0
    while count < states.shape[0] and values[heading, row, column] < math.inf:
        states[count, 0], states[count, 1], states[count, 2] = heading, row, column
        count += 1
        best = values[heading, row, column]
        found = (-1, 0, 0)
        least = math.inf
        for move in range(moves.shape[0]):
            # A move is the same from all headings but for its cost.
            at = (heading - moves[move, 0]) % headings
            at_row, at_column = row - moves[move, 1], column - moves[move, 2]
            if not (0 <= at_row < rows and 0 <= at_column < columns):
                continue
            if values[at, at_row, at_column] >= best:
                continue
            mean = 0.5 * (abs(price[at, at_row, at_column]) + abs(price[heading, row, column]))
            total = values[at, at_row, at_column] + costs[heading, move] * mean
            if total < least:
                least, found = total, (at, at_row, at_column)
        if found[0] < 0:
            break
        heading, row, column = found
    return count
