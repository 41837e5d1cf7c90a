# SPDX-License-Identifier: Apache-2.0
"""An elevation map around a robot: a grid of heights that moves along [Fankhauser2018]."""

import math

import numpy as np
from wasd_core.jit import jit

# An even number of cells, so that their corners are at multiples of the resolution.
RESOLUTION, SIZE = 0.04, 4.0
# A point is of what a cell knows within so many deviations; else it speaks for a rival height.
GATE = 3.0
# As many votes as a height can have: so many points in a row that say otherwise change a cell.
MOST_VOTES = 10.0
# A cell is never surer than this [m^2]: its ground is not flat to the millimetre.
LEAST_VARIANCE = 1e-6
# By how much odometry's height drifts in a second, as a variance [m^2/s]: 1.7 cm in 14 s.
DRIFT = 2e-5
# The drift of odometry's height needs so many points, at most so far off the known heights [m].
FEWEST, FARTHEST_OFF = 100, 0.04
# A ray that passes BELOW [m] under the height of a cell, within PASSED [m] of its end, votes
# against that height. A height that wins by such votes has the variance CLEARED [m^2].
BELOW, PASSED, CLEARED = 0.05, 0.3, 1e-4

# What a cell knows, one layer each; votes are numbers of points, 0 for no height.
_HEIGHT, _VARIANCE, _VOTES, _RIVAL, _RIVAL_VOTES = range(5)


class Elevation:
    """
    Heights of a square of cells around a robot, in the frame of its odometry; z up.

    A cell has the mean and the variance of its height by a Kalman filter. A point beyond the
    gate does not move it: it votes for a rival, which takes the cell when it has the more votes.
    So the heights of both sides of an edge do not mix, and a moved object shows after some
    points. The cells are a ring buffer: a cell left behind is forgotten, no other moves.
    """

    def __init__(self, resolution: float = RESOLUTION, size: float = SIZE) -> None:
        """Take the sides of a cell and, at least, of the square [m]."""
        self.resolution = resolution
        self.count = 2 * math.ceil(0.5 * size / resolution - 1e-9)  # of cells along a side
        self._layers = np.zeros((5, self.count, self.count))
        # The number of the first column (x) and row (y), counted from the frame's origin.
        self._first = np.full(2, -self.count // 2)

    def reset(self) -> None:
        """Forget all heights."""
        self._layers[_VOTES] = 0.0

    def move_to(self, middle: np.ndarray) -> None:
        """Bring the square's middle to the corner of cells next to x and y, (2,) [m]."""
        first = np.round(np.asarray(middle)[:2] / self.resolution).astype(int) - self.count // 2
        for axis in (0, 1):
            moved = int(first[axis] - self._first[axis])
            left = self._first[axis] if moved > 0 else first[axis] + self.count
            gone = np.arange(left, left + min(abs(moved), self.count)) % self.count
            votes = self._layers[_VOTES]
            if axis == 0:
                votes[:, gone] = 0.0
            else:
                votes[gone] = 0.0
        self._first = first

    def age(self, seconds: float) -> None:
        """Increase the variances for odometry's drift over a time [s]."""
        self._layers[_VARIANCE] += DRIFT * seconds

    def add(self, points: np.ndarray, variance: np.ndarray | float) -> None:
        """
        Add points (n, 3) [m] in the frame of odometry, with the variance of their z [m^2].

        The variance is of each, (n,), or of all. Points outside the square, and such as are not
        finite, are left out.
        """
        points = np.ascontiguousarray(points, float).reshape(-1, 3)
        variances = np.array(np.broadcast_to(np.asarray(variance, float), len(points)))
        fine = np.isfinite(points).all(axis=1) & np.isfinite(variances) & (variances > 0.0)
        _fuse(points[fine], variances[fine], self._layers, self.resolution, self._first)

    def clear(self, points: np.ndarray, origin: np.ndarray) -> None:
        """
        Lower cells under which rays passed.

        Rays go from `origin` (3,) to points (n, 3) [m] of walls. Where a wall begins below the
        ground before it, as in a gap, its rays vote against the heights that they passed under.
        """
        fine = np.isfinite(points).all(axis=1)
        points = np.ascontiguousarray(points[fine], float)
        _clear(points, np.asarray(origin, float), self._layers, self.resolution, self._first)

    def offset_of(self, points: np.ndarray) -> float:
        """Return the median height of points (n, 3) above the map [m]; 0 for few points."""
        off = points[:, 2] - self.at(points[:, 0], points[:, 1])
        off = off[np.abs(off) < FARTHEST_OFF]  # not of NaN
        return float(np.median(off)) if len(off) >= FEWEST else 0.0

    def lift(self, height: float) -> None:
        """Move all that is known up [m], as odometry has drifted from it."""
        self._layers[[_HEIGHT, _RIVAL]] += height

    @property
    def corner(self) -> np.ndarray:
        """Where the square begins: its least x and y, (2,) [m]."""
        return self._first * self.resolution

    def heights(self) -> np.ndarray:
        """Return the heights [m], rows along y and columns along x, NaN where unknown."""
        return self._unrolled(_HEIGHT)

    def variances(self) -> np.ndarray:
        """Return the heights' variances [m^2], laid out as they are."""
        return self._unrolled(_VARIANCE)

    def at(self, x: np.ndarray | float, y: np.ndarray | float) -> np.ndarray:
        """Return the heights at places of one shape [m], NaN where unknown and outside."""
        cells = [np.floor(np.asarray(value) / self.resolution).astype(int) for value in (x, y)]
        offsets = [cell - first for cell, first in zip(cells, self._first, strict=True)]
        inside = np.logical_and.reduce([(off >= 0) & (off < self.count) for off in offsets])
        column, row = (cell % self.count for cell in cells)
        known = inside & (self._layers[_VOTES, row, column] > 0.0)
        return np.where(known, self._layers[_HEIGHT, row, column], np.nan)

    def write_window(self, window: np.ndarray, middle: np.ndarray) -> np.ndarray:
        """
        Write heights around x and y into a square (n, n) [m]; return its first column and row.

        A cell has the median of it and of those around it, also where it is not known itself but
        most of them are: so single wrong ones, and holes, do not count, and edges stay. NaN else.
        The cells' numbers are counted from the frame's origin.
        """
        first = np.round(np.asarray(middle)[:2] / self.resolution).astype(int) - len(window) // 2
        _write_medians(self._layers, self._first, first, window)
        return np.asarray(first, float)

    def _unrolled(self, layer: int) -> np.ndarray:
        columns, rows = (
            np.arange(first, first + self.count) % self.count for first in self._first
        )
        cells = np.ix_(rows, columns)
        known = self._layers[_VOTES][cells] > 0.0
        return np.where(known, self._layers[layer][cells], np.nan)


@jit
def _elect(layers: np.ndarray, row: int, column: int, variance: float) -> None:
    """Give a cell the height of its rival, with a variance, if that has the more votes."""
    rival_votes = layers[_RIVAL_VOTES, row, column]
    if rival_votes > layers[_VOTES, row, column]:
        layers[_HEIGHT, row, column] = layers[_RIVAL, row, column]
        layers[_VARIANCE, row, column] = variance
        layers[_VOTES, row, column] = min(rival_votes, MOST_VOTES)
        layers[_RIVAL_VOTES, row, column] = 0.0


@jit
def _fuse(
    points: np.ndarray,
    variances: np.ndarray,
    layers: np.ndarray,
    resolution: float,
    first: np.ndarray,
) -> None:
    """
    Add points to the cells that they are in; each cell's own rule is that of `Elevation`.

    `first` is the number of the first column and row, as it is below.
    """
    count = layers.shape[1]
    height, variance, votes = layers[_HEIGHT], layers[_VARIANCE], layers[_VOTES]
    rival, rival_votes = layers[_RIVAL], layers[_RIVAL_VOTES]
    for k in range(len(points)):
        column = math.floor(points[k, 0] / resolution)
        row = math.floor(points[k, 1] / resolution)
        if not (0 <= column - first[0] < count and 0 <= row - first[1] < count):
            continue
        i, j = row % count, column % count
        z, noise = points[k, 2], variances[k]
        if votes[i, j] == 0.0:
            height[i, j], variance[i, j], votes[i, j] = z, noise, 1.0
            rival_votes[i, j] = 0.0
            continue
        off = z - height[i, j]
        total = variance[i, j] + noise
        if off * off <= GATE * GATE * total:
            gain = variance[i, j] / total
            height[i, j] += gain * off
            variance[i, j] = max((1.0 - gain) * variance[i, j], LEAST_VARIANCE)
            votes[i, j] = min(votes[i, j] + 1.0, MOST_VOTES)
            rival_votes[i, j] = max(rival_votes[i, j] - 1.0, 0.0)
            continue
        from_rival = z - rival[i, j]
        if rival_votes[i, j] > 0.0 and from_rival * from_rival <= 2.0 * GATE * GATE * noise:
            rival_votes[i, j] += 1.0
            rival[i, j] += from_rival / rival_votes[i, j]
            _elect(layers, i, j, noise / rival_votes[i, j])
        elif rival_votes[i, j] <= 1.0:
            rival[i, j], rival_votes[i, j] = z, 1.0
        else:
            rival_votes[i, j] -= 1.0


@jit
def _clear(
    points: np.ndarray,
    origin: np.ndarray,
    layers: np.ndarray,
    resolution: float,
    first: np.ndarray,
) -> None:
    """Vote by rays from `origin` to `points` for the heights at which they passed cells."""
    count = layers.shape[1]
    height, votes = layers[_HEIGHT], layers[_VOTES]
    rival, rival_votes = layers[_RIVAL], layers[_RIVAL_VOTES]
    cells = np.zeros((int(2.0 * PASSED / resolution) + 2, 2), np.int64)
    depths = np.zeros(len(cells))
    for k in range(len(points)):
        dx, dy = origin[0] - points[k, 0], origin[1] - points[k, 1]
        dz, way = origin[2] - points[k, 2], math.hypot(dx, dy)
        found, ground = 0, -math.inf
        for n in range(int(min(way, PASSED) / (0.5 * resolution)) + 1):
            part = n * 0.5 * resolution / max(way, resolution)
            column = math.floor((points[k, 0] + part * dx) / resolution)
            row = math.floor((points[k, 1] + part * dy) / resolution)
            if not (0 <= column - first[0] < count and 0 <= row - first[1] < count):
                continue
            i, j, z = row % count, column % count, points[k, 2] + part * dz
            if votes[i, j] == 0.0:
                continue
            if z > height[i, j]:
                ground = max(ground, height[i, j])
            is_last = found > 0 and cells[found - 1, 0] == i and cells[found - 1, 1] == j
            if height[i, j] - z > BELOW and not is_last:
                cells[found, 0], cells[found, 1], depths[found] = i, j, z
                found += 1
        if ground - points[k, 2] < BELOW:
            continue  # a riser: it stands on what is before it
        for n in range(found):
            i, j, z = cells[n, 0], cells[n, 1], depths[n]
            if rival_votes[i, j] > 0.0 and height[i, j] - rival[i, j] > 0.5 * BELOW:
                rival_votes[i, j] += 1.0
                rival[i, j] += (z - rival[i, j]) / rival_votes[i, j]
            else:
                rival[i, j], rival_votes[i, j] = z, 1.0
            _elect(layers, i, j, CLEARED)


@jit
def _write_medians(
    layers: np.ndarray, known: np.ndarray, first: np.ndarray, window: np.ndarray
) -> None:
    """Write `Elevation.write_window`; `known` and `first` are the squares' first cells."""
    count, size = layers.shape[1], len(window)
    height, votes = layers[_HEIGHT], layers[_VOTES]
    around = np.empty(9)
    for i in range(size):
        for j in range(size):
            found = 0
            for k in range(-1, 2):
                row = first[1] + i + k
                if not 0 <= row - known[1] < count:
                    continue
                row %= count
                for m in range(-1, 2):
                    column = first[0] + j + m
                    if not 0 <= column - known[0] < count:
                        continue
                    column %= count
                    if votes[row, column] > 0.0:
                        z = height[row, column]
                        place = found
                        while place > 0 and around[place - 1] > z:
                            around[place] = around[place - 1]
                            place -= 1
                        around[place] = z
                        found += 1
            row, column = first[1] + i, first[0] + j
            is_own = (
                0 <= row - known[1] < count
                and 0 <= column - known[0] < count
                and votes[row % count, column % count] > 0.0
            )
            if found >= 5 or (is_own and found >= 2):
                middle = found // 2
                is_even = found % 2 == 0
                window[i, j] = (
                    0.5 * (around[middle - 1] + around[middle]) if is_even else around[middle]
                )
            else:
                window[i, j] = np.nan
