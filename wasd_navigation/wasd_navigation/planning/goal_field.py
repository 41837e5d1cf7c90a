# SPDX-License-Identifier: Apache-2.0
"""
The remaining cost to the goal from each cell, around obstacles.

The eikonal equation |grad value| = price, solved by fast marching (Sethian, A fast marching
level set method for monotonically advancing fronts, 1996), upwind and of first order: from a
cell, down the gradient is the shortest way, in any direction, not in steps of 45 degrees.
"""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.planning.distances import Field, look_up
from wasd_navigation.planning.surroundings import Surroundings

# Around the goal, so many cells each way get their straight distance: first order errs most there.
_DISC = 3
# Ways through forbidden cells cost so much more; only a robot that stands in one takes them.
ESCAPE_PRICE = 20.0
# All cells of a map; as many as a DiscField looks at in one step: 6 ms, 12 on a slow host.
WHOLE, CELLS = 1 << 40, 40_000
# Beyond all that is reached [m].
_BEYOND = 10.0
# A way has no more points than this.
_MOST_POINTS = 8000
# A way is followed in steps of half a cell, in the best of so many directions.
_DIRECTIONS = 32


class Heap(NamedTuple):
    """`keys` and `items`, shape (room,), and how many there are in `held`, shape (1,)."""

    keys: np.ndarray
    items: np.ndarray
    held: np.ndarray


def make_heap(room: int) -> Heap:
    """Return an empty heap for so many."""
    return Heap(np.empty(room, np.float32), np.empty(room, np.int32), np.zeros(1, np.int64))


@jit
def push(heap: Heap, key: float, item: int) -> None:
    """Add an item."""
    at = heap.held[0]
    heap.held[0] += 1
    while at > 0:
        parent = (at - 1) >> 1
        if heap.keys[parent] <= key:
            break
        heap.keys[at], heap.items[at] = heap.keys[parent], heap.items[parent]
        at = parent
    heap.keys[at], heap.items[at] = key, item


@jit
def pop(heap: Heap) -> tuple[float, int]:
    """Remove the item with the least key and return key and item; there must be one."""
    least, first = heap.keys[0], heap.items[0]
    heap.held[0] -= 1
    count = heap.held[0]
    key, item = heap.keys[count], heap.items[count]
    at = 0
    while True:
        child = 2 * at + 1
        if child >= count:
            break
        if child + 1 < count and heap.keys[child + 1] < heap.keys[child]:
            child += 1
        if heap.keys[child] >= key:
            break
        heap.keys[at], heap.items[at] = heap.keys[child], heap.items[child]
        at = child
    heap.keys[at], heap.items[at] = key, item
    return least, first


class DiscField:
    """
    The remaining cost to a goal (x, y, yaw) for a round robot.

    `reach` [m] is the least distance of its middle from obstacles. It is worked out in slices:
    `values` and `beyond` are valid once it `is_done`.
    """

    def __init__(
        self,
        goal: np.ndarray,
        around: Surroundings,
        reach: float,
        border: np.ndarray | None = None,
    ) -> None:
        self._goal, self._around, self._reach, self._border = goal, around, reach, border
        self._spreading: Spreading | None = None
        self.is_done = False

    def work(self, _: np.ndarray, __: int) -> bool:
        """Look at up to `CELLS` cells; return whether there is a way to lead from."""
        if self._spreading is None:
            self._spreading = self._begin()
        self.is_done = self._spreading.work(CELLS)
        if self.is_done:
            self.beyond = self._spreading.beyond
        return self.is_done

    def _begin(self) -> 'Spreading':
        around, reach = self._around, self._reach
        distances = around.distances.values[0]
        row, column = map(int, around.grid.to_cells(self._goal[None, :2])[0])
        # Nearer than this, it is the obstacle that is wrong where the robot is.
        escape = (distances < reach) & (distances > 0.5 * reach)
        price = around.price_of(distances - reach)
        resolution = around.grid.resolution
        spreading = Spreading((row, column), price, escape, resolution, self._border)
        # What is around may be another by the time all is known.
        self.values = around.field_of(spreading.values[None])
        return spreading

    def way_from(self, pose: np.ndarray) -> np.ndarray:
        """Return places and headings (x, y, yaw) on the way from a pose, shape (n, 3)."""
        room = np.empty((_MOST_POINTS, 2))
        count = follow(self.values, 0, pose[:2], room)
        places = np.concatenate((room[:count], self._goal[None, :2]))
        way = np.column_stack((places, np.full(len(places), self._goal[2])))
        ahead = np.diff(places, axis=0)
        way[:-1, 2] = np.arctan2(ahead[:, 1], ahead[:, 0])
        return way


class Spreading:
    """
    Values [m of free way], shape (rows, columns), float32, worked out in slices.

    `values`, and `beyond`, which none that is reached exceeds, are valid once all is known. `goal`
    is its cell (row, column). `price`, float32 of the same shape, says what a metre costs in a
    cell, infinite where nobody may be. `escape`, bool, are cells where nobody may be, but from
    which one finds out; what is reached through them only does not count. `border`, float32, is
    what is left from cells beyond which a way goes on, infinite elsewhere.
    """

    def __init__(
        self,
        goal: tuple[int, int],
        price: np.ndarray,
        escape: np.ndarray,
        resolution: float,
        border: np.ndarray | None = None,
    ) -> None:
        self.values, self.beyond = np.full(price.shape, np.inf, np.float32), _BEYOND
        self._price, self._escape, self._resolution = price, escape, resolution
        self._heap, self._is_escaping = make_heap(4 * price.size + 64), False
        # There may be room at the goal, but not in the middle of its cell.
        start_at(self.values, self._heap, price, goal, resolution)
        if border is not None:
            start_along(self.values, self._heap, price, border)

    def work(self, budget: int) -> bool:
        """Look at up to so many cells; return whether all are known."""
        values, heap = self.values, self._heap
        budget = _march(values, heap, self._price, self._resolution, -1, budget)
        if heap.held[0] == 0 and not self._is_escaping:
            self._is_escaping = True
            self._begin_escape()
            budget = _march(values, heap, self._price, self._resolution, -1, budget)
        if heap.held[0] > 0:
            return False
        values[~(values < self.beyond)] = self.beyond
        return True

    def _begin_escape(self) -> None:
        """Go on from all that is reached into where one may only come from."""
        reached = self.values < np.inf
        self.beyond = _BEYOND + (float(self.values[reached].max()) if reached.any() else 0.0)
        into = self._escape & ~reached
        self._price = np.where(into, np.float32(ESCAPE_PRICE), np.float32(np.inf))
        _begin_at_edge(self.values, self._heap, self._price)


def ways_from(cell: np.ndarray, price: np.ndarray, resolution: float) -> np.ndarray:
    """Return how far it is from a cell (row, column) to each [m of free way], float32."""
    values = np.full(price.shape, np.inf, np.float32)
    heap = make_heap(4 * values.size + 64)
    start_at(values, heap, price, (int(cell[0]), int(cell[1])), resolution)
    march(values, heap, price, resolution, WHOLE)
    return values


def shortest(goal: np.ndarray, pose: np.ndarray, around: Surroundings, reach: float) -> float:
    """
    Return about the shortest way [m] between places of a disc that is clear by `reach` [m].

    It is looked for in cells twice as large: that is a matter of 3 ms. Infinite: there is none.
    """
    distances = around.distances.values[0]
    rows, columns = (size // 2 for size in distances.shape)
    room = distances[: 2 * rows, : 2 * columns].reshape(rows, 2, columns, 2).max(axis=(1, 3))
    ends = around.grid.to_cells(np.stack((goal[:2], pose[:2]))) // 2
    ends = np.clip(ends, 0, (rows - 1, columns - 1))
    price = np.where(room > reach, 1.0, np.inf).astype(np.float32)
    price[tuple(ends.T)] = 1.0
    values = np.full((rows, columns), np.inf, np.float32)
    heap = make_heap(4 * rows * columns + 64)
    resolution = 2.0 * around.grid.resolution
    start_at(values, heap, price, (int(ends[0, 0]), int(ends[0, 1])), resolution)
    row, column = map(int, ends[1])
    _march(values, heap, price, resolution, row * columns + column, WHOLE)
    return float(values[row, column])


@jit
def flood(start: np.ndarray, distances: np.ndarray, reach: float) -> np.ndarray:
    """
    Return which cells a disc gets to, bool, from a cell (row, column) or what is next to it.

    Its middle keeps `distances` of at least `reach` [m].
    """
    rows, columns = distances.shape
    seen = np.zeros((rows, columns), np.bool_)
    waiting = np.empty(rows * columns, np.int32)
    held = 0
    for row in range(max(start[0] - _DISC, 0), min(start[0] + _DISC + 1, rows)):
        for column in range(max(start[1] - _DISC, 0), min(start[1] + _DISC + 1, columns)):
            if distances[row, column] >= reach:
                seen[row, column] = True
                waiting[held] = row * columns + column
                held += 1
    while held > 0:
        held -= 1
        row, column = waiting[held] // columns, waiting[held] % columns
        for turn in range(4):
            to_row = row + (turn == 0) - (turn == 1)
            to_column = column + (turn == 2) - (turn == 3)
            if not (0 <= to_row < rows and 0 <= to_column < columns):
                continue
            if not seen[to_row, to_column] and distances[to_row, to_column] >= reach:
                seen[to_row, to_column] = True
                waiting[held] = to_row * columns + to_column
                held += 1
    return seen


@jit
def reaches(
    goal: tuple[int, int], start: tuple[int, int], distances: np.ndarray, reach: float
) -> bool:
    """
    Whether the values of a DiscField would spread from a cell (row, column) to around another.

    The cell `start` has the lowest indices of the four around a place. Nothing is in order of
    value here: that costs a tenth of the field.
    """
    rows, columns = distances.shape
    seen = np.zeros((rows, columns), np.bool_)
    waiting = np.empty((2, rows * columns), np.int32)  # free cells, and where one may escape from
    held = np.zeros(2, np.int64)
    for row in range(max(goal[0] - _DISC, 0), min(goal[0] + _DISC + 1, rows)):
        for column in range(max(goal[1] - _DISC, 0), min(goal[1] + _DISC + 1, columns)):
            if distances[row, column] >= reach:
                seen[row, column] = True
                waiting[0, held[0]] = row * columns + column
                held[0] += 1
    for kind in range(2):
        while held[kind] > 0:
            held[kind] -= 1
            row, column = divmod(waiting[kind, held[kind]], columns)
            if 0 <= row - start[0] <= 1 and 0 <= column - start[1] <= 1:
                return True
            for up, right in ((-1, 0), (1, 0), (0, -1), (0, 1)):
                to_row, to_column = row + up, column + right
                if not (0 <= to_row < rows and 0 <= to_column < columns):
                    continue
                room = distances[to_row, to_column]
                is_tight = room < reach
                if seen[to_row, to_column] or room <= 0.5 * reach or (kind == 1 and not is_tight):
                    continue
                seen[to_row, to_column] = True
                waiting[int(is_tight), held[int(is_tight)]] = to_row * columns + to_column
                held[int(is_tight)] += 1
    return False


@jit
def start_at(
    values: np.ndarray, heap: Heap, price: np.ndarray, goal: tuple[int, int], resolution: float
) -> None:
    """Give what is around a goal, a cell (row, column), its straight distance."""
    rows, columns = values.shape
    for row in range(max(goal[0] - _DISC, 0), min(goal[0] + _DISC + 1, rows)):
        for column in range(max(goal[1] - _DISC, 0), min(goal[1] + _DISC + 1, columns)):
            if price[row, column] < math.inf:
                distance = math.hypot(row - goal[0], column - goal[1]) * resolution
                values[row, column] = distance * price[row, column]
                push(heap, values[row, column], row * columns + column)


@jit
def start_along(values: np.ndarray, heap: Heap, price: np.ndarray, border: np.ndarray) -> None:
    """Begin at free cells from which it is known what is left."""
    rows, columns = values.shape
    for row in range(rows):
        for column in range(columns):
            if border[row, column] < values[row, column] and price[row, column] < math.inf:
                values[row, column] = border[row, column]
                push(heap, values[row, column], row * columns + column)


@jit
def _begin_at_edge(values: np.ndarray, heap: Heap, price: np.ndarray) -> None:
    """Begin at all cells with a value that have a neighbour with a price."""
    rows, columns = values.shape
    for row in range(1, rows - 1):
        for column in range(1, columns - 1):
            if values[row, column] < math.inf:
                least = min(price[row - 1, column], price[row + 1, column])
                least = min(least, price[row, column - 1], price[row, column + 1])
                if least < math.inf:
                    push(heap, values[row, column], row * columns + column)


@jit
def march(
    values: np.ndarray, heap: Heap, price: np.ndarray, resolution: float, budget: int
) -> bool:
    """Spread values, from up to so many cells; return whether all are known."""
    _march(values, heap, price, resolution, -1, budget)
    return bool(heap.held[0] == 0)


@jit
def _march(
    values: np.ndarray, heap: Heap, price: np.ndarray, resolution: float, until: int, budget: int
) -> int:
    """
    Spread values until that of a cell, by its number, is known; -1: all of them.

    Look at up to `budget` cells; return how many more it might have been.
    """
    rows, columns = values.shape
    while heap.held[0] > 0 and budget > 0:
        budget -= 1
        value, cell = pop(heap)
        if cell == until:
            break
        row, column = cell // columns, cell % columns
        if value > values[row, column]:
            continue
        for turn in range(4):
            up = (turn == 0) - (turn == 1)
            right = (turn == 2) - (turn == 3)
            if 0 <= row + up < rows and 0 <= column + right < columns:
                new = _solve(values, price, row + up, column + right, resolution)
                if new < values[row + up, column + right]:
                    values[row + up, column + right] = new
                    push(heap, values[row + up, column + right], cell + up * columns + right)
    return budget


@jit
def _solve(
    values: np.ndarray, price: np.ndarray, row: int, column: int, resolution: float
) -> np.float32:
    """Return the value of a cell by its lowest neighbours in x and y."""
    step = price[row, column] * resolution
    if not step < math.inf:
        return np.float32(math.inf)
    rows, columns = values.shape
    across = values[row, column - 1] if column > 0 else np.float32(math.inf)
    if column + 1 < columns:
        across = min(across, values[row, column + 1])
    up = values[row - 1, column] if row > 0 else np.float32(math.inf)
    if row + 1 < rows:
        up = min(up, values[row + 1, column])
    low, high = min(across, up), max(across, up)
    if high - low >= step:
        return np.float32(low + step)
    return np.float32(0.5 * (low + high + math.sqrt(2.0 * step * step - (high - low) ** 2)))


@jit
def follow(field: Field, layer: int, start: np.ndarray, way: np.ndarray) -> int:
    """
    Write the way down a layer from (x, y) to `way`, shape (room, 2) [m]; return its points.

    It ends where no direction leads down any more: at the goal.
    """
    step = 0.5 * field.resolution
    x, y = start[0], start[1]
    value = look_up(field, layer, x, y)
    count = 0
    while count < way.shape[0]:
        way[count, 0], way[count, 1] = x, y
        count += 1
        best, best_x, best_y = value, x, y
        for direction in range(_DIRECTIONS):
            angle = 2.0 * math.pi * direction / _DIRECTIONS
            to_x, to_y = x + 2.0 * step * math.cos(angle), y + 2.0 * step * math.sin(angle)
            there = look_up(field, layer, to_x, to_y)
            if there < best:
                best, best_x, best_y = there, 0.5 * (x + to_x), 0.5 * (y + to_y)
        if best_x == x and best_y == y:
            break
        x, y = best_x, best_y
        value = min(best, look_up(field, layer, x, y))
    return count
