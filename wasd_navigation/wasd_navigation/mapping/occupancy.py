# SPDX-License-Identifier: Apache-2.0
"""What is free and what is occupied: log-odds of cells, from rays [Moravec1985]."""

import math

import numpy as np
from wasd_core.jit import jit

from wasd_navigation.mapping.surface import Surface
from wasd_navigation.records import FREE, Grid, OCCUPIED, Scan, UNKNOWN

# Log-odds that a ray adds to the cell that it ends in, a scan to each cell that it looks through,
# and a ray to the cells behind and before its end, down to a doubt: one hit by noise, among many
# that say that the surface is elsewhere, does not make a cell occupied.
HIT, MISS, BESIDE, DOUBT = 0.9, -0.6, -0.6, -0.4
# Cosine of the angle between normal and ray from which on the cell before is none of the surface.
STEEP = 0.5
# A surface so near to the next cell fills that, too [cells]: two cells then tell that it is
# between them, and a localizer has it more exactly than one cell can say.
NEAR = 0.15
# A scan looks through a cell whose middle is this far before a surface [cells] ...
MARGIN = 0.5
# ... and lies between two neighbouring rays that are no farther apart there [m].
WIDEST = 0.15
# An end of a ray that is known worse than this adds less [cells].
SURE = 0.4
# What a hit takes from cells that are as likely to be meant, within two deviations.
ELSEWHERE = 0.5
# As far as a cell is believed either way: what has moved is seen after some scans.
MOST, LEAST = 3.0, -3.0
# Above and below these a cell is occupied and free.
OCCUPIED_FROM, FREE_TO = 0.5, -0.5
# By how much the canvas grows when it must [m].
GROWTH = 0.5


class Canvas:
    """Log-odds of a grid that grows with what is drawn; 0 where nothing is known."""

    def __init__(self, resolution: float) -> None:
        self._resolution = resolution
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._odds = np.zeros((0, 0), dtype=np.float32)
        self._corner = np.zeros(2, dtype=np.int64)  # cell (x, y) of the first column and row

    def draw(self, scan: Scan, surface: Surface, pose: np.ndarray) -> None:
        """Draw a scan with its surface, taken at a pose of the base."""
        self._cover(scan.begins, surface.ends, pose)
        _draw(
            *self.odds,
            pose,
            scan.begins,
            surface.ends,
            np.where(scan.hits, surface.slants, 0.0),
            surface.deviations,
        )

    @property
    def odds(self) -> tuple[np.ndarray, tuple[float, int, int]]:
        """Log-odds, shape (rows, columns); resolution [m] and cell (x, y) of the first."""
        return self._odds, (self._resolution, int(self._corner[0]), int(self._corner[1]))

    def grid(self) -> Grid:
        """Return what is known of each cell."""
        cells = np.full(self._odds.shape, UNKNOWN, dtype=np.int8)
        cells[self._odds > OCCUPIED_FROM] = OCCUPIED
        cells[self._odds < FREE_TO] = FREE
        corner = self._corner * self._resolution
        return Grid(cells, self._resolution, (float(corner[0]), float(corner[1])))

    def _cover(self, begins: np.ndarray, ends: np.ndarray, pose: np.ndarray) -> None:
        """Grow so that rays as they are drawn lie in it: kernels do not look at its bounds."""
        if not len(ends):
            return
        left, low, right, high = _bounds(pose, begins, ends, self._resolution)
        (x, y), (rows, columns) = self._corner.tolist(), self._odds.shape
        if rows and left >= x and low >= y and right <= x + columns and high <= y + rows:
            return
        self._grow(np.array((left, low)), np.array((right, high)))

    def _grow(self, low: np.ndarray, high: np.ndarray) -> None:
        """Enlarge the grid so that it has all cells (x, y) from `low` to before `high`."""
        size = np.array(self._odds.shape[::-1])
        end = self._corner + size
        margin = round(GROWTH / self._resolution)
        if size.all():
            low = np.where(low < self._corner, low - margin, self._corner)
            high = np.where(high > end, high + margin, end)
        grown = np.zeros(tuple((high - low)[::-1].tolist()), dtype=np.float32)
        column, row = (self._corner - low).tolist()
        if size.all():
            grown[row : row + size[1], column : column + size[0]] = self._odds
        self._odds, self._corner = grown, low


@jit
def _bounds(
    pose: np.ndarray, begins: np.ndarray, ends: np.ndarray, resolution: float
) -> tuple[int, int, int, int]:
    """Return the first cell (x, y) and that after the last that rays touch, one more around."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    left, low, right, high = np.inf, np.inf, -np.inf, -np.inf
    for points in (begins, ends):
        for index in range(points.shape[0]):
            px, py = points[index]
            x, y = pose[0] + cos * px - sin * py, pose[1] + sin * px + cos * py
            left, right = min(left, x), max(right, x)
            low, high = min(low, y), max(high, y)
    return (
        math.floor(left / resolution) - 1,
        math.floor(low / resolution) - 1,
        math.floor(right / resolution) + 2,
        math.floor(high / resolution) + 2,
    )


@jit
def _draw(
    odds: np.ndarray,
    frame: tuple[float, int, int],
    pose: np.ndarray,
    begins: np.ndarray,
    ends: np.ndarray,
    slants: np.ndarray,
    deviations: np.ndarray,
) -> None:
    """
    Add a scan's rays to log-odds; `frame` is resolution and cell (x, y) of the first one.

    `slants`, shape (n,), of each ray is 0 where nothing was hit; `deviations`, shape (n,), are
    those of where they end [m].
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    scale = 1.0 / frame[0]
    # Where each ray begins and points to, and how far it says that all is free [cells].
    first = np.empty((ends.shape[0], 2))
    ahead, far = np.empty((ends.shape[0], 2)), np.empty(ends.shape[0])
    for ray in range(ends.shape[0]):
        bx, by = begins[ray]
        first[ray, 0] = (pose[0] + cos * bx - sin * by) * scale - frame[1]
        first[ray, 1] = (pose[1] + sin * bx + cos * by) * scale - frame[2]
        dx, dy = ends[ray, 0] - bx, ends[ray, 1] - by
        length = max(1e-9, math.hypot(dx, dy))
        ahead[ray, 0], ahead[ray, 1] = (
            (cos * dx - sin * dy) / length,
            (sin * dx + cos * dy) / length,
        )
        far[ray] = length * scale
        if slants[ray] > 0.0:
            deviation = deviations[ray] * scale
            # Spread over more cells a hit tells less of each.
            hit = HIT * min(1.0, SURE / deviation)
            steep = slants[ray] > STEEP
            _hit(
                odds, (first[ray, 0], first[ray, 1]), ahead[ray], far[ray], (hit, steep), deviation
            )
            far[ray] -= max(MARGIN / max(0.03, slants[ray]), 2.0 * deviation)
    most = WIDEST * scale
    for ray in range(ends.shape[0]):
        after = ray + 1 if ray + 1 < ends.shape[0] else 0
        length = min(far[ray], far[after])
        _look_through(odds, first[ray], first[after], (ahead[ray], ahead[after]), length, most)


@jit
def _hit(
    odds: np.ndarray,
    begin: tuple[float, float],
    ahead: np.ndarray,
    length: float,
    hit: tuple[float, bool],
    deviation: float,
) -> None:
    """
    Add the end of a ray from a place (x, y) [cells], and what is near it on the ray.

    `hit` is by how much, and whether it ends on a surface that it meets steeply; `deviation` is
    that of the end [cells].
    """
    more, is_steep = hit
    column, row = -1, -1
    for place in (length - NEAR, length, length + NEAR):
        before = column, row
        x, y = begin[0] + place * ahead[0], begin[1] + place * ahead[1]
        column, row = int(math.floor(x)), int(math.floor(y))
        if (column, row) != before:
            odds[row, column] = min(MOST, odds[row, column] + more)
    if deviation > SURE:
        _doubt_band(odds, begin, ahead, (length, 2.0 * deviation + 1.0), more)
    # The cells beside it are hit by noise only; of that behind, no ray goes through to say so.
    _doubt(odds, x, y, ahead[0], ahead[1])
    if is_steep:
        x, y = x - 2.0 * NEAR * ahead[0], y - 2.0 * NEAR * ahead[1]
        _doubt(odds, x, y, -ahead[0], -ahead[1])


@jit
def _doubt_band(
    odds: np.ndarray,
    begin: tuple[float, float],
    ahead: np.ndarray,
    band: tuple[float, float],
    more: float,
) -> None:
    """Add that a surface is less likely where a ray does not end, but might have [cells]."""
    for step in range(1, math.ceil(band[1])):
        for side in (-1.0, 1.0):
            place = band[0] + side * (step + NEAR)
            x, y = begin[0] + place * ahead[0], begin[1] + place * ahead[1]
            column, row = int(math.floor(x)), int(math.floor(y))
            inside = 0 <= row < odds.shape[0] and 0 <= column < odds.shape[1]
            if inside and odds[row, column] > DOUBT:
                odds[row, column] = max(DOUBT, odds[row, column] - ELSEWHERE * more)


@jit
def _doubt(odds: np.ndarray, x: float, y: float, along_x: float, along_y: float) -> None:
    """Add that the next cell from a place (x, y) [cells] along a direction is not occupied."""
    column, row = int(math.floor(x)), int(math.floor(y))
    to_x = (column + 1 - x if along_x > 0.0 else x - column) / max(1e-12, abs(along_x))
    to_y = (row + 1 - y if along_y > 0.0 else y - row) / max(1e-12, abs(along_y))
    if to_x < to_y:
        column += 1 if along_x > 0.0 else -1
    else:
        row += 1 if along_y > 0.0 else -1
    if 0 <= row < odds.shape[0] and 0 <= column < odds.shape[1] and odds[row, column] > DOUBT:
        odds[row, column] = max(DOUBT, odds[row, column] + BESIDE)


@jit
def _look_through(
    odds: np.ndarray,
    begin: np.ndarray,
    other: np.ndarray,
    ahead: tuple[np.ndarray, np.ndarray],
    length: float,
    most: float,
) -> None:
    """
    Add that cells are free whose middle is between two rays of a length [cells].

    They begin at `begin` and `other`, in the same place or nearly so, and point `ahead`.
    """
    first, second = ahead
    across = abs(first[0] * second[1] - first[1] * second[0])
    if first[0] * second[0] + first[1] * second[1] <= 0.0:
        return
    length = min(length, most / max(1e-9, across))
    if length <= 0.0:
        return
    # Lines of cells along the rays are few and long: x runs along them, y from one to the next.
    inner = 1 if abs(first[1]) > abs(first[0]) else 0
    outer = 1 - inner
    x3, y3 = other[inner] - begin[inner], other[outer] - begin[outer]
    x1, y1 = length * first[inner], length * first[outer]
    x2, y2 = x3 + length * second[inner], y3 + length * second[outer]
    # Middles are at half cells; sides that two triangles share belong to one of them.
    x0, y0 = begin[inner] - 0.5, begin[outer] - 0.5
    low = math.ceil(y0 + min(min(0.0, y3), min(y1, y2)))
    high = math.ceil(y0 + max(max(0.0, y3), max(y1, y2)))
    slope, slope_across = _slope(x1, y1), _slope(x2 - x1, y2 - y1)
    slope_back, slope_begin = _slope(x3 - x2, y3 - y2), _slope(x3, y3)
    for line in range(max(0, low), min(odds.shape[inner], high)):
        y = line - y0
        left, right = np.inf, -np.inf
        above = y >= 0.0, y >= y1, y >= y2, y >= y3
        if above[0] != above[1]:
            x = slope * y
            left, right = min(left, x), max(right, x)
        if above[1] != above[2]:
            x = x1 + slope_across * (y - y1)
            left, right = min(left, x), max(right, x)
        if above[2] != above[3]:
            x = x2 + slope_back * (y - y2)
            left, right = min(left, x), max(right, x)
        if above[3] != above[0]:
            x = slope_begin * y
            left, right = min(left, x), max(right, x)
        if left > right:
            continue
        start = max(0, math.ceil(x0 + left))
        end = min(odds.shape[outer], math.ceil(x0 + right))
        if inner == 0:
            for column in range(start, end):
                odds[line, column] = max(LEAST, odds[line, column] + MISS)
        else:
            for row in range(start, end):
                odds[row, line] = max(LEAST, odds[row, line] + MISS)


@jit
def _slope(x: float, y: float) -> float:
    """Return x over y; 0 where no line lies between."""
    return x / y if y != 0.0 else 0.0
