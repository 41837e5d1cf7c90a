# SPDX-License-Identifier: Apache-2.0
"""Steps in heights: those that are too high to climb, risers, edges."""

import numpy as np

from wasd_navigation.records import FREE, OCCUPIED, UNKNOWN

# Ground that is not seen between two places that are may rise or fall by so much more a metre.
STEEPEST = 0.6
# Of the cells around one of a step so many, it among them, are as high, but for so much [m].
ALIKE, FEWEST = 0.08, 3
# A riser is higher than this [m].
RISER = 0.06
# An edge is a greater difference of heights [m] within so many cells.
EDGE, EDGE_CELLS = 0.05, 2


def judge(heights: np.ndarray, cell: float, climb: float) -> np.ndarray:
    """
    Return FREE, OCCUPIED or UNKNOWN for heights [m], NaN where unknown, of cells of a side [m].

    A cell that is more than `climb` [m] higher than one beside it is occupied: the front of what
    is too high, or the edge before what is too deep. So is one with cells that are not seen
    between it and the next that is, of the same row or column, where the ground between them
    would be steeper than stairs. A single cell that is like none beside it is a wrong one.
    """
    known = np.isfinite(heights)
    judged = np.where(known, FREE, UNKNOWN).astype(np.int8)
    is_edge = np.zeros(heights.shape, bool)
    for axis in (0, 1):
        count = heights.shape[axis]
        last, following = _neighbours(known, axis)
        for index in (last, following):
            at = np.clip(index, 0, count - 1)
            across = np.take_along_axis(heights, at, axis)
            cells = np.abs(index - np.arange(count).reshape((-1, 1) if axis == 0 else (1, -1)))
            allowed = climb + STEEPEST * cell * (cells - 1)
            is_edge |= (index >= 0) & (index < count) & (heights - across > allowed)
    judged[is_edge & _has_alike(heights)] = OCCUPIED
    return judged


def _has_alike(heights: np.ndarray) -> np.ndarray:
    """Return which cells have others of their height beside them."""
    padded = np.pad(heights, 1, constant_values=np.nan)
    rows, columns = heights.shape
    count = np.zeros(heights.shape, int)
    for row in range(3):
        for column in range(3):
            other = padded[row : row + rows, column : column + columns]
            count += np.abs(other - heights) < ALIKE
    return count >= FEWEST


def find_risers(heights: np.ndarray) -> np.ndarray:
    """Return which cells have a riser between them and the next of their row or column, bool."""
    found = np.zeros(heights.shape, bool)
    found[:-1] = np.abs(np.diff(heights, axis=0)) > RISER
    found[:, :-1] |= np.abs(np.diff(heights, axis=1)) > RISER
    return found


def _neighbours(known: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the index along an axis of the known cell before each cell, and of that after it."""
    count = known.shape[axis]
    index = np.arange(count).reshape((-1, 1) if axis == 0 else (1, -1))
    last = np.maximum.accumulate(np.where(known, index, -1), axis=axis)
    from_end = np.flip(np.where(known, index, count), axis)
    following = np.flip(np.minimum.accumulate(from_end, axis=axis), axis)
    before, after = (np.roll(found, by, axis) for found, by in ((last, 1), (following, -1)))
    edge = [slice(None), slice(None)]
    edge[axis] = slice(0, 1)
    before[tuple(edge)] = -1
    edge[axis] = slice(count - 1, count)
    after[tuple(edge)] = count
    return before, after


def highest(heights: np.ndarray, reach: int) -> np.ndarray:
    """Return the greatest height of all cells within a reach of each [cells]; NaN: none known."""
    return -_lowest(-heights, reach)


def _lowest(heights: np.ndarray, reach: int) -> np.ndarray:
    """Return the least height of all cells within a reach of each [cells]; NaN: none known."""
    found = np.where(np.isfinite(heights), heights, np.inf)
    for axis in (0, 1):
        pad = [(0, 0), (0, 0)]
        pad[axis] = (reach, reach)
        padded = np.pad(found, pad, constant_values=np.inf)
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis)
        found = windows.min(axis=-1)
    return np.where(np.isfinite(found), found, np.nan)


def is_near(found: np.ndarray, reach: int) -> np.ndarray:
    """Return which cells have one that is found within a reach [cells], bool."""
    return np.asarray(highest(found.astype(float), reach) > 0.0)


def find_edges(heights: np.ndarray, most: float) -> np.ndarray:
    """Return near which cells the ground has an edge of no more than `most` [m], bool."""
    spread = highest(heights, EDGE_CELLS) - _lowest(heights, EDGE_CELLS)
    return np.asarray((spread > EDGE) & (spread < most))
