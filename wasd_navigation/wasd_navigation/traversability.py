# SPDX-License-Identifier: Apache-2.0
"""Which ground a legged robot can walk on, by the heights that it has mapped [Wermelinger2016]."""

import math

import numpy as np

from wasd_navigation.records import FREE, Grid, OCCUPIED, UNKNOWN
from wasd_navigation.se2 import inverse, transform, wrap

# Ground that is not seen between two places that are may rise or fall by so much more a metre.
STEEPEST = 0.6
# A ray ends on ground that is no more than this below its end [m], at a place within so much [m].
ABOVE, AROUND = 0.06, 0.12
# Ground is so far from steps that are too high [cells]. Of the cells beside one of these so many,
# it among them, are about as high [m].
NEAR, ALIKE, FEWEST = 2, 0.08, 3
# What is no farther than this from an obstacle of the map is that obstacle [m].
OF_THE_MAP = 0.1
# Ground that rises by so much on a ray's way may go on to rise beyond what is seen of it [m].
RISE = 0.08
# A ray's way is looked along at places so far apart [m], up to so far before its end [m].
_APART, _LONGEST = 0.04, 2.5
# An obstacle of the map is none where ground that can be climbed has an edge of so much [m] within
# so many cells: it is the riser.
_EDGE, _EDGE_CELLS = 0.05, 2

# It climbs straight where stairs lie on its way within so much ahead, or under it so far from its
# middle [m]. They have a riser, and the slope of a plane through the ground so far around the
# middle of that way [m], of which such a share is known.
RISER, AHEAD, TRODDEN, SLOPE, AROUND_WAY, ENOUGH = 0.06, 0.8, 0.25, 0.12, 0.5, 0.3
# A way across, by the cosine of its angle with the slope, leads where the robot looks; to where it
# has come from a way leads by a greater one.
ACROSS, BACK = 0.35, 0.8
# The error of heading that makes it stand [rad]; turns for an error [1/s], up to a rate [rad/s].
ASKEW, TURN, TURN_LIMIT = 0.35, 1.5, 0.5


class Traversability:
    """
    Judges heights: cells are free, occupied where a step is higher than `climb` [m], or unknown.

    Judged cells are kept in the frame of the map. Those of the last heights, in odometry's frame,
    also tell which of a lidar's rays end on ground.
    """

    def __init__(self, climb: float) -> None:
        """Take the highest step that the robot can climb [m]."""
        self.climb = climb
        self.reset()

    def reset(self) -> None:
        """Forget all ground."""
        self.revision = 0
        self._heights = np.full((1, 1), np.nan)
        self._ground = self._tops = self._heights
        self._corner, self._cell = np.zeros(2), 1.0
        self._risers = np.zeros((1, 1), bool)
        self._uphill = 0.0  # 1 while it goes up stairs, -1 down
        self._floor = -np.inf  # height of the ground under the lowest foot [m]
        self._lethal = np.empty((0, 2))  # middles of occupied cells of the last heights [m]
        self._grid: Grid | None = None
        self._edges: np.ndarray = np.zeros((0, 0), bool)

    def take(
        self,
        heights: np.ndarray,
        corner: np.ndarray,
        cell: float,
        floor: float,
        correction: np.ndarray,
        resolution: float,
    ) -> None:
        """
        Take heights (rows along y, columns along x) [m], NaN where unknown, in odometry's frame.

        `corner` (2,) is the least x and y, `cell` the side of a cell, `floor` the height of the
        ground under the lowest foot [m]. `correction` is T_map_odom, shape (3,), `resolution` that
        of the map [m].
        """
        self._heights, self._corner, self._cell = heights, corner, cell
        judged = judge(heights, cell, self.climb)
        # What is seen of a wall, or of a box, is no ground that a ray ends on.
        is_step = np.isfinite(_highest(np.where(judged == OCCUPIED, 0.0, np.nan), NEAR))
        self._ground = np.where(is_step, np.nan, heights)
        self._tops, self._floor = _highest(self._ground, round(AROUND / cell)), floor
        self._risers = _risers(heights)
        rows, columns = np.nonzero(judged == OCCUPIED)
        self._lethal = corner + cell * (np.column_stack((columns, rows)) + 0.5)
        self._keep(judged, correction, resolution)
        self.revision += 1

    def _keep(self, judged: np.ndarray, correction: np.ndarray, resolution: float) -> None:
        """Write judged cells over those of the map."""
        size = self._cell * np.array(judged.shape[::-1])
        corners = self._corner + size * np.array(((0, 0), (0, 1), (1, 0), (1, 1)))
        placed = transform(correction, corners)
        low, high = placed.min(axis=0), placed.max(axis=0)
        if self._grid is None or self._grid.resolution != resolution:
            x, y = (resolution * np.floor(low / resolution)).tolist()
            self._grid = Grid(np.full((1, 1), UNKNOWN, np.int8), resolution, (x, y))
            self._edges = np.zeros((1, 1), bool)
        before: Grid = self._grid
        self._grid = grid = before.grown_to(low, resolution).grown_to(high, resolution)
        if grid is not before:
            row, column = grid.to_cells(before.to_points(np.zeros((1, 2))))[0]
            edges = np.zeros(grid.cells.shape, bool)
            height, width = self._edges.shape
            edges[row : row + height, column : column + width] = self._edges
            self._edges = edges
        cells = grid.cells
        first, last = grid.to_cells(np.stack((low, high)))
        rows, columns = (np.arange(*ends) for ends in zip(first, last + 1, strict=True))
        places = np.stack(np.meshgrid(rows, columns, indexing='ij'), axis=-1).reshape(-1, 2)
        at = transform(inverse(correction), grid.to_points(places))
        column, row = np.floor((at - self._corner) / self._cell).astype(int).T
        inside = (row >= 0) & (row < judged.shape[0]) & (column >= 0) & (column < judged.shape[1])
        places, row, column = places[inside], row[inside], column[inside]
        known = judged[row, column] != UNKNOWN
        there = tuple(places[known].T)
        cells[there] = judged[row, column][known]
        self._edges[there] = _has_riser(self._heights, 1.2 * self.climb)[row, column][known]
        lethal = grid.to_cells(transform(correction, self._lethal))
        cells[tuple(lethal.T)] = OCCUPIED

    def over(self, grid: Grid) -> Grid:
        """
        Return a map with what is known of the ground.

        Steps that are too high are occupied. Free ground makes unknown cells free, and such cells
        of the map as are occupied by the risers of steps that can be climbed.
        """
        if self._grid is None:
            return grid
        judged = np.argwhere(self._grid.cells != UNKNOWN)
        places = grid.to_cells(self._grid.to_points(judged))
        inside = grid.covers(places)
        here, there = tuple(judged[inside].T), tuple(places[inside].T)
        ground, edges, known = self._grid.cells[here], self._edges[here], grid.cells[there]
        reach = round(OF_THE_MAP / grid.resolution)
        walls = np.isfinite(_highest(np.where(grid.cells == OCCUPIED, 0.0, np.nan), reach))
        is_mapped = np.where(ground == FREE, (known > FREE) & ~edges, walls[there])
        ground = np.where(is_mapped, known, ground)
        merged = grid.cells.copy()
        merged[there] = ground
        return Grid(merged, grid.resolution, grid.origin)

    def steps_near(self, place: np.ndarray, reach: float) -> np.ndarray:
        """Return the steps of the last heights that are too high, (n, 2) [m], within a reach."""
        away = self._lethal - place[:2]
        near = np.hypot(away[:, 0], away[:, 1]) < reach
        return np.asarray(self._lethal[near])

    def is_ground(self, begins: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """
        Return which rays end on ground that the robot can walk on, shape (n,).

        `begins` (n, 2) and `ends` (n, 3) are in odometry's frame [m]. So do those that end lower
        than the feet.
        """
        tops = self._at(self._tops, ends[:, :2])
        on_known = ends[:, 2] <= np.fmax(tops, self._floor) + ABOVE
        return np.asarray(on_known | self._goes_on(begins, ends))

    def straighten(self, velocity: np.ndarray, pose: np.ndarray, way: np.ndarray) -> np.ndarray:
        """
        Return a velocity (vx, vy, wz) that climbs straight where the way ahead is steep, (3,).

        `pose` (3,) is the base's and `way` (n, 2) what is left of its path, in odometry's frame. A
        robot that climbs stairs at an angle slips off their edges: so it turns along the slope
        first, and moves only ahead.
        """
        ahead = way[np.hypot(*(way - pose[:2]).T) < AHEAD]
        if not len(ahead) or not velocity[:2].any():
            return velocity
        toward = self._straight_way(pose, ahead)
        if toward is None:
            return velocity
        turn = wrap(math.atan2(toward[1], toward[0]) - float(pose[2]))
        speed = math.hypot(velocity[0], velocity[1]) * max(1.0 - abs(turn) / ASKEW, 0.0)
        return np.array((speed, 0.0, min(max(TURN * turn, -TURN_LIMIT), TURN_LIMIT)))

    def _straight_way(self, pose: np.ndarray, ahead: np.ndarray) -> np.ndarray | None:
        """Return which way along stairs to go, (2,), where there are some; see `straighten`."""
        before, self._uphill = self._uphill, 0.0
        heading = np.array((math.cos(pose[2]), math.sin(pose[2])))
        trodden = pose[:2] + TRODDEN * np.outer((1.0, 0.0, -1.0), heading)
        heights = self._at(self._heights, np.concatenate((ahead, trodden)))
        heights = heights[np.isfinite(heights)]
        gradient = self._gradient(ahead[len(ahead) // 2])
        slope = math.hypot(*gradient)
        if slope < SLOPE or not len(heights) or float(np.ptp(heights)) < RISE:
            return None
        toward = ahead[-1] - pose[:2]
        along = float(gradient @ toward) / (slope * max(math.hypot(*toward), 1e-9))
        if abs(along) < ACROSS:
            along = float(gradient @ heading)
        if before * along < 0.0 and abs(along) < BACK:
            along = before
        self._uphill = math.copysign(1.0, along)
        return np.asarray(self._uphill * gradient)

    def _gradient(self, place: np.ndarray) -> np.ndarray:
        """Return how steep stairs around a place are, (2,); zeros where there are none."""
        rows, columns = self._heights.shape
        x = self._corner[0] + self._cell * (np.arange(columns) + 0.5) - place[0]
        y = self._corner[1] + self._cell * (np.arange(rows) + 0.5) - place[1]
        x, y = np.meshgrid(x, y)
        is_near = np.hypot(x, y) < AROUND_WAY
        used = np.isfinite(self._heights) & is_near
        if used.sum() < ENOUGH * is_near.sum() or not (self._risers & is_near).any():
            return np.zeros(2)
        terms = np.column_stack((x[used], y[used], np.ones(used.sum())))
        fit = np.linalg.lstsq(terms, self._heights[used], rcond=None)[0]
        return np.asarray(fit[:2])

    def _goes_on(self, begins: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Return which rays end where ground that rises on their way may go on to rise."""
        way = ends[:, :2] - begins
        lengths = np.maximum(np.hypot(way[:, 0], way[:, 1]), 1e-9)
        back = np.arange(_APART, _LONGEST, _APART)
        shares = 1.0 - back / lengths[:, None]
        places = begins[:, None] + shares[..., None] * way[:, None]
        heights = self._at(self._ground, places.reshape(-1, 2)).reshape(len(ends), len(back))
        heights[shares < 0.0] = np.nan
        known = np.isfinite(heights)
        has_any = known.any(axis=1)
        nearest = np.argmax(known, axis=1)
        last = np.take_along_axis(heights, nearest[:, None], 1)[:, 0]
        lowest = np.where(known, heights, np.inf).min(axis=1)
        rises = last - lowest > RISE
        most = last + self.climb + STEEPEST * back[nearest]
        return np.asarray(has_any & rises & (ends[:, 2] <= most))

    def _at(self, layer: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return a layer at places (n, 2) [m], NaN outside."""
        column, row = np.floor((places - self._corner) / self._cell).astype(int).T
        rows, columns = layer.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        values = np.full(len(places), np.nan)
        values[inside] = layer[row[inside], column[inside]]
        return values


def judge(heights: np.ndarray, cell: float, climb: float) -> np.ndarray:
    """
    Return FREE, OCCUPIED or UNKNOWN for heights [m], NaN where unknown, of cells of a side [m].

    A cell that is more than `climb` [m] higher than one beside it is occupied: the front of what
    is too high, or the edge before what is too deep. So is one with cells that are not seen
    between it and the next that is, of the same row or column, where the ground between them
    would be steeper than stairs. Single cells that none beside is like are wrong ones.
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


def _risers(heights: np.ndarray) -> np.ndarray:
    """Return which cells are before a riser."""
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


def _highest(heights: np.ndarray, reach: int) -> np.ndarray:
    """Return the greatest height of all cells within a reach of each [cells]; NaN: none known."""
    return -_lowest(-heights, reach)


def _lowest(heights: np.ndarray, reach: int) -> np.ndarray:
    found = np.where(np.isfinite(heights), heights, np.inf)
    for axis in (0, 1):
        pad = [(0, 0), (0, 0)]
        pad[axis] = (reach, reach)
        padded = np.pad(found, pad, constant_values=np.inf)
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis)
        found = windows.min(axis=-1)
    return np.where(np.isfinite(found), found, np.nan)


def _has_riser(heights: np.ndarray, most: float) -> np.ndarray:
    """Return beside which cells the ground rises or falls at an edge, by no more than so much."""
    spread = _highest(heights, _EDGE_CELLS) - _lowest(heights, _EDGE_CELLS)
    return np.asarray((spread > _EDGE) & (spread < most))
