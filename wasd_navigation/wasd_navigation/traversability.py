# SPDX-License-Identifier: Apache-2.0
"""Which ground a legged robot can walk on, by the heights that it has mapped [Wermelinger2016]."""

import math

import numpy as np

from wasd_navigation.records import FREE, Grid, OCCUPIED, UNKNOWN
from wasd_navigation.se2 import inverse, transform, wrap
from wasd_navigation.steps import find_edges, find_risers, highest, is_near, judge, STEEPEST

# A ray ends on ground that is no more than this below its end [m], at a place within so much [m].
ABOVE, AROUND = 0.06, 0.12
# Ground is so far from steps that are too high [cells].
NEAR = 2
# What is no farther than this from an obstacle of the map is that obstacle [m].
OF_THE_MAP = 0.1
# An obstacle of the map is a riser, and free, if the ground there has an edge of at most so many
# times the highest step that can be climbed.
CLIMBED = 1.2
# Ground that rises by so much on a ray's way may go on to rise beyond what is seen of it [m].
RISE = 0.08
# A ray's way is looked along at places so far apart [m], up to so far before its end [m].
_APART, _LONGEST = 0.04, 2.5

# It climbs straight where stairs lie on its way within so much ahead, or under it so far from its
# middle [m]. They have a riser, and the slope of a plane through the ground so far around the
# middle of that way [m], of which such a share is known.
AHEAD, TRODDEN, SLOPE, AROUND_WAY, ENOUGH = 0.8, 0.25, 0.12, 0.5, 0.3
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
        self._ground = np.where(is_near(judged == OCCUPIED, NEAR), np.nan, heights)
        self._tops, self._floor = highest(self._ground, round(AROUND / cell)), floor
        self._risers = find_risers(heights)
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
            grown = np.zeros(grid.cells.shape, bool)
            height, width = self._edges.shape
            grown[row : row + height, column : column + width] = self._edges
            self._edges = grown
        cells = grid.cells
        first, last = grid.to_cells(np.stack((low, high)))
        rows, columns = (np.arange(*ends) for ends in zip(first, last + 1, strict=True))
        places = np.stack(np.meshgrid(rows, columns, indexing='ij'), axis=-1).reshape(-1, 2)
        at = transform(inverse(correction), grid.to_points(places))
        inside, row, column = self._cells_at(at)
        places = places[inside]
        known = judged[row, column] != UNKNOWN
        edges = find_edges(self._heights, CLIMBED * self.climb)
        there = tuple(places[known].T)
        cells[there] = judged[row, column][known]
        self._edges[there] = edges[row, column][known]
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
        walls = is_near(grid.cells == OCCUPIED, reach)
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

        `begins` (n, 2) and `ends` (n, 3) are in odometry's frame [m]. What is lower than the feet
        is ground, too.
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
        inside, row, column = self._cells_at(places)
        values = np.full(len(places), np.nan)
        values[inside] = layer[row, column]
        return values

    def _cells_at(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return which places (n, 2) [m] the last heights cover, and rows and columns of those."""
        column, row = np.floor((places - self._corner) / self._cell).astype(int).T
        rows, columns = self._heights.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return inside, row[inside], column[inside]
