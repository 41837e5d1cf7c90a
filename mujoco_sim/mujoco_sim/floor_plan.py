# SPDX-License-Identifier: Apache-2.0
"""Floor plans as worlds: what is occupied in a map becomes walls, and a place to start is free."""

import numpy as np
from wasd_core.errors import SimulationError
from wasd_core.map_picture import FREE, MapPicture, OCCUPIED, UNKNOWN

from mujoco_sim.flats import WALL_HEIGHT

# More boxes than this make physics and lidars slow; cells are then merged, at most so often.
MOST_BOXES, MOST_MERGED = 5000, 3
# Free room wanted around the start [m], for two robots side by side; else the most there is.
AROUND = (0.9, 0.7, 0.5, 0.4, 0.3)


def make_floor_plan(plan: MapPicture) -> tuple[np.ndarray, float]:
    """
    Return the walls of a map, and the side of the cells that they are made of [m].

    Walls are boxes like those of a `Flat`, shape (n, 6), around the free place that is nearest to
    the map's origin: there the robot starts, at the world's.
    A box may reach into unknown cells beside a wall: what a lidar has drawn has ragged backs.
    Where they would be too many boxes cells are merged, two by two: walls are thicker then.

    Raises:
        SimulationError: nothing is free, or walls are too many.
    """
    walls = plan.cells == OCCUPIED
    may_be = ~_clear(walls, 1, outside=False) & (plan.cells == UNKNOWN) | walls
    start = find_start(plan)
    cell = plan.resolution
    for _ in range(MOST_MERGED + 1):
        rectangles = merge(walls, may_be, MOST_BOXES)
        if rectangles is not None:
            break
        walls, may_be, cell = _coarser(walls), _coarser(walls), 2.0 * cell
    else:
        raise SimulationError(
            f'wanted a plan of at most {MOST_BOXES} boxes, this one has more, even in cells of '
            f'{0.5 * cell:g} m: draw fewer, straighter walls'
        )
    low = rectangles[:, 1::-1] * cell + plan.origin - start
    sizes = (rectangles[:, 3:1:-1] - rectangles[:, 1::-1]) * cell
    heights = np.full(len(low), WALL_HEIGHT)
    boxes = np.column_stack((low + 0.5 * sizes, 0.5 * sizes, heights, np.zeros(len(low))))
    return boxes, cell


def find_start(plan: MapPicture) -> np.ndarray:
    """
    Return the free place nearest to the origin with room around it, shape (2,) [m].

    Raises:
        SimulationError: there is none, not even with less room.
    """
    is_taken = plan.cells != FREE
    for around in AROUND:
        reach = int(np.ceil(around / plan.resolution - 1e-6))
        rows, columns = np.nonzero(_clear(is_taken, reach))
        if len(rows):
            points = (np.column_stack((columns, rows)) + 0.5) * plan.resolution + plan.origin
            place: np.ndarray = points[np.argmin(np.hypot(*points.T))]
            return place
    raise SimulationError(f'no free place of {2.0 * AROUND[-1]:g} m for a robot to start at')


def _clear(is_taken: np.ndarray, reach: int, outside: bool = True) -> np.ndarray:
    """
    Return which cells have no taken cell within `reach` cells around them, bool.

    `outside` is whether cells beyond the edge are taken.
    """
    padded = np.pad(is_taken, reach + 1, constant_values=outside)
    sums = padded.cumsum(axis=0, dtype=np.int32).cumsum(axis=1, dtype=np.int32)
    side = 2 * reach + 1
    count = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    rows, columns = is_taken.shape
    clear: np.ndarray = count[:rows, :columns] == 0
    return clear


def _coarser(walls: np.ndarray) -> np.ndarray:
    """Return cells twice as long, which are walls where any of four is one."""
    rows, columns = walls.shape
    even = np.pad(walls, ((0, rows % 2), (0, columns % 2)))
    return np.asarray(even.reshape(len(even) // 2, 2, -1, 2).any(axis=(1, 3)))


def merge(walls: np.ndarray, may_be: np.ndarray, most: int) -> np.ndarray | None:
    """
    Return rectangles that cover the walls; None where they are too many.

    They cover nothing but cells that `may_be` walls. Each, shape (4,), is the first row and
    column, and those after the last. The first cell that is left begins a rectangle: of two, that
    grow along one axis, then along the other, the one that covers more of what is left.
    """
    left = walls.copy()
    found: list[tuple[int, int, int, int]] = []
    for row in np.flatnonzero(walls.any(axis=1)).tolist():
        at = 0
        while len(ahead := np.flatnonzero(left[row, at:])):
            if len(found) == most:
                return None
            at += int(ahead[0])
            free = may_be[row:, at:]
            right, below = _grown(free)
            down, beside = _grown(free.T)
            flat, tall = left[row : row + below, at : at + right], left[row:, at:][:down, :beside]
            best = flat if flat.sum() >= tall.sum() else tall
            best[:] = False
            found.append((row, at, row + best.shape[0], at + best.shape[1]))
            at += 1
    return np.array(found, dtype=np.int64).reshape(-1, 4)


def _grown(cells: np.ndarray) -> tuple[int, int]:
    """Return how many columns and rows a rectangle has that grows to the right first."""
    gap = int(cells[0].argmin())
    columns = len(cells[0]) if cells[0, gap] else gap
    rows = 1
    while rows < len(cells) and cells[rows, :columns].all():
        rows += 1
    return columns, rows
