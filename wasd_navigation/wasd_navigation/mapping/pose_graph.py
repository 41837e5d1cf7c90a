# SPDX-License-Identifier: Apache-2.0
"""
Poses of places from what is known of pairs of them, by sparse Gauss-Newton in small portions.

Nodes are eliminated in the order of least degree [Tinney1967]; the factor of the normal equations
is block-sparse, with blocks of 3 x 3.
"""

from collections.abc import Callable, Iterator
import heapq
import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.se2 import put

# Products of blocks of one portion: half a millisecond.
PORTION = 4000
# Steps shorter than this are none [m], [rad]; more of them are not taken.
SMALLEST, MOST_STEPS = 5e-4, 6


class Edges(NamedTuple):
    """
    What is known of pairs of nodes.

    `pairs`, shape (e, 2): the numbers of two nodes; `poses`, shape (e, 3): the second in the frame
    of the first; `informations`, shape (e, 3, 3), of that pose; `robust`, shape (e,): whether it
    may be wrong.
    """

    pairs: np.ndarray
    poses: np.ndarray
    informations: np.ndarray
    robust: np.ndarray


class Pattern(NamedTuple):
    """
    The factor's columns in the order of elimination.

    `order`, shape (n,), are nodes; `begins`, shape (n + 1,), says where the rows of a column,
    nodes that come later, begin in `rows`.
    """

    order: np.ndarray
    begins: np.ndarray
    rows: np.ndarray


class System(NamedTuple):
    """Normal equations by the pattern: blocks on the diagonal, below it, right-hand side."""

    diagonal: np.ndarray  # (n, 3, 3), by node
    below: np.ndarray  # (b, 3, 3): row's block by column, as Pattern.rows
    right: np.ndarray  # (n, 3), by node


@jit
def find_pattern(count: int, pairs: np.ndarray) -> Pattern:
    """
    Return in which order to eliminate nodes 1 to count - 1 (0 stays), and what fills in.

    Of nodes of the least degree the first is next; a heap has each node with every degree that it
    has had, of which only the last counts.
    """
    degree = np.zeros(count, dtype=np.int64)
    near = np.empty((count, 16), dtype=np.int32)
    for edge in range(pairs.shape[0]):
        a, b = pairs[edge]
        if a > 0 and b > 0:
            near = _join(a, b, degree, near)
    order = np.empty(count - 1, dtype=np.int64)
    begins = np.zeros(count, dtype=np.int64)
    rows = np.empty(16 * count, dtype=np.int64)
    left = np.ones(count, dtype=np.bool_)
    left[0] = False
    used = 0
    waiting = [(degree[node], np.int64(node)) for node in range(1, count)]
    heapq.heapify(waiting)
    for turn in range(count - 1):
        known, best = heapq.heappop(waiting)
        while not left[best] or known != degree[best]:
            known, best = heapq.heappop(waiting)
        order[turn] = best
        left[best] = False
        if used + count > rows.shape[0]:
            grown = np.empty(2 * rows.shape[0] + count, dtype=np.int64)
            put(grown[:used], rows)
            rows = grown
        first = used
        for index in range(degree[best]):
            rows[used] = near[best, index]
            used += 1
        for i in range(first, used):
            a = rows[i]
            # Take the eliminated node out, then link its neighbours with one another.
            for index in range(degree[a]):
                if near[a, index] == best:
                    degree[a] -= 1
                    near[a, index] = near[a, degree[a]]
                    break
            for j in range(first, i):
                near = _join(a, rows[j], degree, near)
        for i in range(first, used):
            heapq.heappush(waiting, (degree[rows[i]], rows[i]))
        begins[turn + 1] = used
    return Pattern(order, begins, rows[:used].copy())


@jit
def _join(a: int, b: int, degree: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Make two nodes neighbours; return all neighbours, maybe with more room for them."""
    for index in range(degree[a]):
        if near[a, index] == b:
            return near
    room = near.shape[1]
    if max(degree[a], degree[b]) == room:
        wider = np.empty((near.shape[0], 2 * room), dtype=np.int32)
        for node in range(near.shape[0]):
            put(wider[node, :room], near[node])
        near = wider
    near[a, degree[a]], near[b, degree[b]] = b, a
    degree[a] += 1
    degree[b] += 1
    return near


@jit
def linearise(poses: np.ndarray, edges: Edges, pattern: Pattern) -> System:
    """Return the normal equations at poses, shape (n, 3), of steps of nodes 1 to n - 1."""
    count = poses.shape[0]
    turn_of = np.zeros(count, dtype=np.int64)
    for turn in range(count - 1):
        turn_of[pattern.order[turn]] = turn
    diagonal = np.zeros((count, 3, 3))
    below = np.zeros((pattern.rows.shape[0], 3, 3))
    right = np.zeros((count, 3))
    A, B, error = np.zeros((3, 3)), np.zeros((3, 3)), np.empty(3)
    WA, WB = np.empty((3, 3)), np.empty((3, 3))
    for edge in range(edges.pairs.shape[0]):
        a, b = edges.pairs[edge]
        weight = _linearise_edge(poses, edges, edge, A, B, error)
        _weigh(edges.informations[edge], weight, A, WA)
        _weigh(edges.informations[edge], weight, B, WB)
        _add_right(right[a], WA, error)
        _add_right(right[b], WB, error)
        _add_product(diagonal[a], A, WA)
        _add_product(diagonal[b], B, WB)
        if a > 0 and b > 0:
            first, last = (a, b) if turn_of[a] < turn_of[b] else (b, a)
            turn = turn_of[first]
            for at in range(pattern.begins[turn], pattern.begins[turn + 1]):
                if pattern.rows[at] == last:
                    if last == b:
                        _add_product(below[at], B, WA)
                    else:
                        _add_product(below[at], A, WB)
                    break
    return System(diagonal, below, right)


@jit
def _weigh(information: np.ndarray, weight: float, A: np.ndarray, out: np.ndarray) -> None:
    """Write weight information A."""
    for i in range(3):
        for j in range(3):
            out[i, j] = weight * (
                information[i, 0] * A[0, j]
                + information[i, 1] * A[1, j]
                + information[i, 2] * A[2, j]
            )


@jit
def _add_product(target: np.ndarray, first: np.ndarray, second: np.ndarray) -> None:
    """Add first^T second to a block."""
    for i in range(3):
        for j in range(3):
            target[i, j] += (
                first[0, i] * second[0, j]
                + first[1, i] * second[1, j]
                + first[2, i] * second[2, j]
            )


@jit
def _add_right(target: np.ndarray, weighted: np.ndarray, error: np.ndarray) -> None:
    """Subtract weighted^T error from a part of the right-hand side."""
    for i in range(3):
        for j in range(3):
            target[i] -= weighted[j, i] * error[j]


@jit
def _linearise_edge(
    poses: np.ndarray, edges: Edges, edge: int, A: np.ndarray, B: np.ndarray, error: np.ndarray
) -> float:
    """Write an edge's error and its derivatives by its two poses; return its weight."""
    a, b = edges.pairs[edge]
    cos, sin = math.cos(poses[a, 2]), math.sin(poses[a, 2])
    dx, dy = poses[b, 0] - poses[a, 0], poses[b, 1] - poses[a, 1]
    x, y = cos * dx + sin * dy, -sin * dx + cos * dy
    error[0] = x - edges.poses[edge, 0]
    error[1] = y - edges.poses[edge, 1]
    turn = poses[b, 2] - poses[a, 2] - edges.poses[edge, 2]
    error[2] = (turn + math.pi) % (2.0 * math.pi) - math.pi
    # What stays 0 is 0 from the start.
    A[0, 0], A[0, 1], A[0, 2] = -cos, -sin, y
    A[1, 0], A[1, 1], A[1, 2] = sin, -cos, -x
    B[0, 0], B[0, 1], B[1, 0], B[1, 1] = cos, sin, -sin, cos
    A[2, 2], B[2, 2] = -1.0, 1.0
    if not edges.robust[edge]:
        return 1.0
    # Cauchy's weight; the square of a right edge is 3 on average.
    square = 0.0
    for i in range(3):
        for j in range(3):
            square += error[i] * edges.informations[edge, i, j] * error[j]
    return 1.0 / (1.0 + square / 27.0)


@jit
def factorise(system: System, pattern: Pattern, turn: int, budget: int) -> int:
    """
    Factorise columns from `turn` on, in place, until so many block products are done.

    Returns the turn to go on with; the last is the number of columns.
    """
    count = pattern.order.shape[0]
    turn_of = np.zeros(count + 1, dtype=np.int64)
    for index in range(count):
        turn_of[pattern.order[index]] = index
    where = np.zeros(count + 1, dtype=np.int64)
    done = 0
    while turn < count and done < budget:
        node = pattern.order[turn]
        begin, end = pattern.begins[turn], pattern.begins[turn + 1]
        L = system.diagonal[node]
        _take_root(L)
        for at in range(begin, end):
            _solve_rows(L, system.below[at])
        for at in range(begin, end):
            column = pattern.rows[at]
            mine = system.below[at]
            _subtract(system.diagonal[column], mine, mine)
            its_turn = turn_of[column]
            for entry in range(pattern.begins[its_turn], pattern.begins[its_turn + 1]):
                where[pattern.rows[entry]] = entry
            for other in range(begin, end):
                if turn_of[pattern.rows[other]] > its_turn:
                    _subtract(system.below[where[pattern.rows[other]]], system.below[other], mine)
        done += (end - begin) * (end - begin) + 4
        turn += 1
    return turn


@jit
def _solve_rows(L: np.ndarray, block: np.ndarray) -> None:
    """Replace a block X by X L^-T, with L lower triangular."""
    for i in range(3):
        for j in range(3):
            value = block[i, j]
            for k in range(j):
                value -= block[i, k] * L[j, k]
            block[i, j] = value / L[j, j]


@jit
def _subtract(target: np.ndarray, first: np.ndarray, second: np.ndarray) -> None:
    """Subtract first second^T from a block."""
    for i in range(3):
        for j in range(3):
            target[i, j] -= (
                first[i, 0] * second[j, 0]
                + first[i, 1] * second[j, 1]
                + first[i, 2] * second[j, 2]
            )


@jit
def _take_root(block: np.ndarray) -> None:
    """Replace a block by its Cholesky factor; above the diagonal nothing is read."""
    for i in range(3):
        for j in range(i + 1):
            value = block[i, j]
            for k in range(j):
                value -= block[i, k] * block[j, k]
            block[i, j] = math.sqrt(value) if i == j else value / block[j, j]


@jit
def solve(system: System, pattern: Pattern) -> np.ndarray:
    """Return the steps of all nodes, shape (n, 3), of a factorised system; node 0's is 0."""
    steps = system.right.copy()
    steps[0, 0] = steps[0, 1] = steps[0, 2] = 0.0
    count = pattern.order.shape[0]
    for turn in range(count):
        node = pattern.order[turn]
        step, L = steps[node], system.diagonal[node]
        for i in range(3):
            for j in range(i):
                step[i] -= L[i, j] * step[j]
            step[i] /= L[i, i]
        for at in range(pattern.begins[turn], pattern.begins[turn + 1]):
            other = steps[pattern.rows[at]]
            for i in range(3):
                for j in range(3):
                    other[i] -= system.below[at, i, j] * step[j]
    for turn in range(count - 1, -1, -1):
        node = pattern.order[turn]
        step, L = steps[node], system.diagonal[node]
        for at in range(pattern.begins[turn], pattern.begins[turn + 1]):
            other = steps[pattern.rows[at]]
            for i in range(3):
                for j in range(3):
                    step[i] -= system.below[at, j, i] * other[j]
        for i in range(2, -1, -1):
            for j in range(i + 1, 3):
                step[i] -= L[j, i] * step[j]
            step[i] /= L[i, i]
    return steps


class Solver:
    """Works on the poses that it was given first, until they have settled and are taken."""

    def __init__(self) -> None:
        self._is_asked = False
        self._running: Iterator[np.ndarray | None] | None = None
        self._solved: np.ndarray | None = None

    @property
    def is_idle(self) -> bool:
        """Whether it begins with other poses when it works next."""
        return self._running is None and self._solved is None

    def ask(self) -> None:
        """Want the poses solved for, now or after what is being solved."""
        self._is_asked = True

    def take(self) -> np.ndarray | None:
        """Return the poses if they have settled, of the nodes that there were then."""
        solved, self._solved = self._solved, None
        return solved

    def work(self, poses: np.ndarray, edges: Callable[[], Edges]) -> bool:
        """Do one portion, and return whether there was one to do."""
        if self._running is None:
            if not self._is_asked or self._solved is not None:
                return False
            self._is_asked = False
            self._running = _solve(poses.copy(), edges())
        self._solved = next(self._running)
        if self._solved is not None:
            self._running = None
        return True


def _solve(poses: np.ndarray, edges: Edges) -> Iterator[np.ndarray | None]:
    pattern = find_pattern(len(poses), edges.pairs)
    for _ in range(MOST_STEPS):
        yield None
        system = linearise(poses, edges, pattern)
        turn = 0
        while turn < len(pattern.order):
            turn = factorise(system, pattern, turn, PORTION)
            if turn < len(pattern.order):
                yield None
        steps = solve(system, pattern)
        poses = poses + steps
        poses[:, 2] = (poses[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
        if np.abs(steps).max() < SMALLEST:
            break
    yield poses
