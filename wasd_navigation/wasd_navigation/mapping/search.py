# SPDX-License-Identifier: Apache-2.0
"""
Where a scan fits a grid best, searched everywhere in a window, in small portions.

Branch and bound on a pyramid of grids [Hess2016]: a cell of a level has the largest value of the
cells that it may stand for, so that no pose within does better than it says.
"""

from collections.abc import Iterator
import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.records import Grid, OCCUPIED
from wasd_navigation.se2 import put

LEVELS = 5  # cells of 1.6 m at the top of one of 10 cm
CELL = 0.10  # [m]
STEP = math.radians(1.5)  # of headings [rad]
# What a point scores at this distance from what is occupied is exp(-1/2) [m].
BLUR = 0.10
MOST_POINTS = 100
# So many nodes are scored in one portion: about half a millisecond.
PORTION = 2000
# Poses that score this share of the best are kept, too; at most so many.
KEPT, MOST_KEPT = 0.8, 4000


class Window(NamedTuple):
    """Poses to search: least and greatest x, y [m], first heading, count of `STEP`s."""

    low: np.ndarray
    high: np.ndarray
    heading: float
    headings: int


def window_around(pose: np.ndarray, reach: np.ndarray, turn: float) -> Window:
    """Return poses within `reach` (x, y) [m] and `turn` [rad] of a pose."""
    steps = math.ceil(min(turn, math.pi - 0.5 * STEP) / STEP)
    begin = float(pose[2]) - steps * STEP
    return Window(pose[:2] - reach, pose[:2] + reach, begin, 2 * steps + 1)


class Found(NamedTuple):
    """Poses, shape (n, 3), that score best, and their scores, 0 to 1, in falling order."""

    poses: np.ndarray
    scores: np.ndarray


class Pyramid:
    """Levels of a grid: how likely an end of a ray is there, 0 to 255, and its maxima."""

    def __init__(self, grid: Grid) -> None:
        size = grid.resolution * np.array(grid.cells.shape[::-1])
        self.low = np.array(grid.origin)
        self.high = self.low + size
        # Room around it: rays end outside, too, and cells of a level reach over the border.
        self.corner = np.floor(self.low / CELL).astype(np.int64) - 2
        shape = np.ceil(size / CELL).astype(np.int64)[::-1] + 4
        occupied = np.argwhere(grid.cells == OCCUPIED)
        places = (grid.to_points(occupied) / CELL) - self.corner
        levels = [_blur(places, int(shape[0]), int(shape[1]))]
        for level in range(LEVELS - 1):
            levels.append(_widen(levels[-1], 1 << level))
        self.levels = np.stack(levels)

    @property
    def everywhere(self) -> Window:
        """All poses in the grid."""
        return Window(self.low, self.high, -math.pi, round(2.0 * math.pi / STEP))


@jit
def _blur(places: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """Return how near each cell is to places (x, y) [cells], as 255 exp(-d^2 / 2 blur^2)."""
    values = np.zeros((rows, columns), dtype=np.uint8)
    reach = int(3.0 * BLUR / CELL)
    for index in range(places.shape[0]):
        x, y = places[index]
        column, row = int(math.floor(x)), int(math.floor(y))
        for r in range(max(0, row - reach), min(rows, row + reach + 1)):
            for c in range(max(0, column - reach), min(columns, column + reach + 1)):
                square = ((c + 0.5 - x) ** 2 + (r + 0.5 - y) ** 2) * CELL * CELL
                value = int(255.0 * math.exp(-0.5 * square / (BLUR * BLUR)))
                if value > values[r, c]:
                    values[r, c] = value
    return values


@jit
def _widen(values: np.ndarray, step: int) -> np.ndarray:
    """Return for each cell the largest of four that are `step` apart, from it on upward."""
    rows, columns = values.shape
    widened = values.copy()
    for row in range(rows):
        for column in range(columns):
            for r in (row, row + step):
                for c in (column, column + step):
                    if r < rows and c < columns and values[r, c] > widened[row, column]:
                        widened[row, column] = values[r, c]
    return widened


class _Work(NamedTuple):
    """
    What a search keeps: nodes (level, x, y, heading, score) that wait, and leaves.

    `counts` are how many wait, how many leaves there are, and the best score.
    """

    stack: np.ndarray
    leaves: np.ndarray
    counts: np.ndarray


class Search:
    """Searches a window for where points, shape (n, 2) in the base frame, fit a pyramid."""

    def __init__(self, pyramid: Pyramid, points: np.ndarray, window: Window) -> None:
        self._pyramid = pyramid
        self._window = window
        self._headings = window.heading + STEP * np.arange(window.headings)
        self._rays = _turn_points(_thin(points), self._headings)
        self._running = self._run()
        self.found: Found | None = None
        self.moved = np.zeros(3)  # the robot, since this began

    def work(self) -> bool:
        """Do one portion; return whether all is done, and `found` is there."""
        if self.found is None:
            self.found = next(self._running)
        return self.found is not None

    def _run(self) -> Iterator[Found | None]:
        levels, rays = self._pyramid.levels, self._rays
        if not rays.shape[1]:
            yield Found(np.zeros((0, 3)), np.zeros(0))
            return
        nodes = self._top_nodes()
        for begin in range(0, len(nodes), PORTION):
            _score(levels, rays, nodes[begin : begin + PORTION])
            yield None
        # The best last: it is taken first.
        order = np.argsort(nodes[:, 4], kind='stable')
        stack = np.zeros((len(nodes) + 4 * LEVELS, 5), dtype=np.int64)
        stack[: len(nodes)] = nodes[order]
        work = _Work(stack, np.zeros((MOST_KEPT, 5), dtype=np.int64), np.array((len(nodes), 0, 0)))
        limits = self._limits()
        while work.counts[0]:
            _descend(levels, rays, limits, work, PORTION)
            yield None
        yield self._collect(work)

    def _limits(self) -> np.ndarray:
        """Return the first and the last cell (x, y) of the window, shape (2, 2)."""
        corner = self._pyramid.corner
        low = np.floor(self._window.low / CELL).astype(np.int64) - corner
        high = np.floor(self._window.high / CELL).astype(np.int64) - corner
        last = np.array(self._pyramid.levels.shape[:0:-1]) - 1
        return np.stack((np.maximum(low, 0), np.minimum(high, last)))

    def _top_nodes(self) -> np.ndarray:
        """Return the nodes of the top level (level, x, y, heading, 0), shape (n, 5)."""
        low, high = self._limits()
        step = 1 << (LEVELS - 1)
        axes = [np.arange(a, b + 1, step) for a, b in zip(low, high, strict=True)]
        x, y, heading = np.meshgrid(*axes, np.arange(len(self._headings)), indexing='ij')
        level, zero = np.full(x.size, LEVELS - 1), np.zeros(x.size, dtype=np.int64)
        return np.stack((level, x.ravel(), y.ravel(), heading.ravel(), zero), axis=1)

    def _collect(self, work: _Work) -> Found:
        leaves = work.leaves[: work.counts[1]]
        leaves = leaves[leaves[:, 4] >= KEPT * work.counts[2]]
        leaves = leaves[np.argsort(-leaves[:, 4], kind='stable')]
        places = (leaves[:, 1:3] + self._pyramid.corner + 0.5) * CELL
        poses = np.column_stack((places, self._headings[leaves[:, 3]]))
        return Found(poses, leaves[:, 4] / (255.0 * self._rays.shape[1]))


@jit
def _thin(points: np.ndarray) -> np.ndarray:
    """Return some of the points, not too many, and none near the one before."""
    kept = np.empty_like(points)
    count = 0
    for index in range(points.shape[0]):
        dx, dy = 1.0, 1.0
        if count:
            dx, dy = points[index, 0] - kept[count - 1, 0], points[index, 1] - kept[count - 1, 1]
        if dx * dx + dy * dy > CELL * CELL:
            put(kept[count], points[index])
            count += 1
    stride = 1 + count // MOST_POINTS
    return kept[:count:stride].copy()


@jit
def _turn_points(points: np.ndarray, headings: np.ndarray) -> np.ndarray:
    """Return points as whole cells (x, y) at each heading, shape (headings, n, 2)."""
    turned = np.empty((headings.shape[0], points.shape[0], 2), dtype=np.int32)
    for heading in range(headings.shape[0]):
        cos, sin = math.cos(headings[heading]), math.sin(headings[heading])
        for index in range(points.shape[0]):
            x, y = points[index]
            turned[heading, index, 0] = int(math.floor((cos * x - sin * y) / CELL + 0.5))
            turned[heading, index, 1] = int(math.floor((sin * x + cos * y) / CELL + 0.5))
    return turned


@jit
def _score_one(values: np.ndarray, rays: np.ndarray, x: int, y: int, reach: int) -> int:
    """Return the sum of what ends of rays, shape (n, 2), score from a cell."""
    rows, columns = values.shape
    total = 0
    for index in range(rays.shape[0]):
        column, row = x + rays[index, 0], y + rays[index, 1]
        # A cell before the border stands for some behind it.
        if -reach < column < 0:
            column = 0
        if -reach < row < 0:
            row = 0
        if 0 <= column < columns and 0 <= row < rows:
            total += values[row, column]
    return total


@jit
def _score(levels: np.ndarray, rays: np.ndarray, nodes: np.ndarray) -> None:
    """Write the scores of nodes."""
    for index in range(nodes.shape[0]):
        level, x, y, heading = nodes[index, 0], nodes[index, 1], nodes[index, 2], nodes[index, 3]
        nodes[index, 4] = _score_one(levels[level], rays[heading], x, y, 1 << level)


@jit
def _descend(
    levels: np.ndarray, rays: np.ndarray, limits: np.ndarray, work: _Work, budget: int
) -> None:
    """Split nodes that may hold something good, until so many are scored."""
    children = np.zeros((4, 5), dtype=np.int64)
    done = 0
    while work.counts[0] > 0 and done < budget:
        work.counts[0] -= 1
        node = work.stack[work.counts[0]].copy()
        if node[4] < KEPT * work.counts[2] or node[4] == 0:
            continue
        if node[0] == 0:
            if work.counts[1] < work.leaves.shape[0]:
                put(work.leaves[work.counts[1]], node)
                work.counts[1] += 1
            work.counts[2] = max(work.counts[2], node[4])
            continue
        level = node[0] - 1
        half = 1 << level
        used = 0
        for dx in range(0, 2 * half, half):
            for dy in range(0, 2 * half, half):
                x, y = node[1] + dx, node[2] + dy
                if x > limits[1, 0] or y > limits[1, 1]:
                    continue
                score = _score_one(levels[level], rays[node[3]], x, y, half)
                at = used
                # The best last: it is taken first.
                while at > 0 and children[at - 1, 4] > score:
                    put(children[at], children[at - 1])
                    at -= 1
                children[at, 0], children[at, 1], children[at, 2] = level, x, y
                children[at, 3], children[at, 4] = node[3], score
                used += 1
        for index in range(used):
            put(work.stack[work.counts[0]], children[index])
            work.counts[0] += 1
        done += used
