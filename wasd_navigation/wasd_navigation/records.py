# SPDX-License-Identifier: Apache-2.0
"""Records: a lidar's scan and an occupancy grid."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np
from wasd_core.errors import InvalidMessage
from wasd_core.rotations import Pose

from wasd_core import map_picture
from wasd_navigation.se2 import transform

UNKNOWN, FREE, OCCUPIED = map_picture.UNKNOWN, map_picture.FREE, map_picture.OCCUPIED
# Of a keepout area, where a robot that stands inside leaves it: free to drive, but not for goals.
OPENED = UNKNOWN - 1
FEWEST = map_picture.FEWEST
# Cells are no farther away than this: what is must not overflow.
_FARTHEST = 2.0**60
# What a tilted lidar sees below this height is the floor [m]; nor is anything that ends less far
# below the lidar.
FLOOR, LEAST_DESCENT = 0.05, 0.02
# What is nearer or farther is not seen, whatever a lidar says of itself (0 is no echo); and so far
# a ray is free at most that hits nothing [m].
NEAREST, HORIZON, FREE_SIGHT = 1e-3, 100.0, 30.0
# No lidar has so many rays.
MOST_RAYS = 100_000
# From its first ray to its last a scan takes no longer [s].
LONGEST_SWEEP = 1.0
# So many rays beside each other may have got no echo, beside others that have.
MOST_LOST = 2
# A lidar above the base's origin that is too high to see the floor.
LEVEL = Pose(np.array([0.0, 0.0, 1.0]), np.eye(3))


# Which rays from begins (n, 2) to ends (n, 3) end on ground that the robot can walk on [m].
IsGround = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Grid:
    """
    Cells, shape (rows, columns), int8: -1 unknown, 0 free, to 100 occupied.

    Row 0 is the lowest y, column 0 the lowest x; `origin` (x, y) [m] is the corner of cell
    (0, 0) with the lowest coordinates, `resolution` the length of a cell [m]. Axes are those of
    the map frame.
    """

    cells: np.ndarray
    resolution: float
    origin: tuple[float, float]

    def to_cells(self, points: np.ndarray) -> np.ndarray:
        """Return (row, column), shape (n, 2), of points, shape (n, 2) [m]; maybe outside."""
        steps = np.floor((points - np.array(self.origin)) / self.resolution)
        cells: np.ndarray = np.clip(steps, -_FARTHEST, _FARTHEST)[:, ::-1].astype(np.int64)
        return cells

    def to_points(self, cells: np.ndarray) -> np.ndarray:
        """Return the centres [m], shape (n, 2), of cells (row, column), shape (n, 2)."""
        points: np.ndarray = (cells[:, ::-1] + 0.5) * self.resolution + np.array(self.origin)
        return points

    def covers(self, cells: np.ndarray) -> np.ndarray:
        """Return which cells (row, column), shape (n, 2), lie in the grid, shape (n,)."""
        inside: np.ndarray = np.all((cells >= 0) & (cells < self.cells.shape), axis=1)
        return inside

    def has(self, point: np.ndarray) -> bool:
        """Return whether a point, shape (2,) [m], lies in the grid."""
        return bool(self.covers(self.to_cells(point[None]))[0])

    def grown_to(self, point: np.ndarray, border: float) -> 'Grid':
        """Return it with unknown cells up to a border [m] around a point, shape (2,) [m]."""
        low, high = self.to_cells(np.stack((point - border, point + border)))
        before = np.maximum(-low, 0)
        after = np.maximum(high + 1 - self.cells.shape, 0)
        if not before.any() and not after.any():
            return self
        width = tuple(zip(before.tolist(), after.tolist(), strict=True))
        cells = np.pad(self.cells, width, constant_values=UNKNOWN)
        x, y = np.array(self.origin) - before[::-1] * self.resolution
        return Grid(cells, self.resolution, (float(x), float(y)))


@dataclass(frozen=True)
class Scan:
    """
    Rays in the base frame of one instant (x ahead, y left) [m].

    `origin`, shape (2,), is where the lidar is then; `ends`, shape (n, 2), are where rays end: at
    what they hit where `hits`, shape (n,), is true, else at the lidar's range, with nothing before
    it. Of a lidar that has moved meanwhile `begins`, shape (n, 2), are where they begin.
    """

    origin: np.ndarray
    ends: np.ndarray
    hits: np.ndarray
    begins: np.ndarray = None  # type: ignore[assignment]
    added: int = 0  # so many at the end are no rays of the lidar: see `with_hits`
    heights: np.ndarray | None = None  # of the ends, shape (n,) [m]; None: not known

    def __post_init__(self) -> None:
        """Let all rays begin at the origin if nothing else is said."""
        if self.begins is None:
            begins = np.repeat(self.origin[None], len(self.ends), axis=0)
            object.__setattr__(self, 'begins', begins)

    def seen_from(self, pose: np.ndarray) -> 'Scan':
        """Return the same as seen from another frame, in which this one has a pose, shape (3,)."""
        return Scan(
            transform(pose, self.origin[None])[0],
            transform(pose, self.ends),
            self.hits,
            transform(pose, self.begins),
            self.added,
        )

    def with_hits(self, points: np.ndarray) -> 'Scan':
        """Return it with rays that hit points, shape (m, 2) [m], too."""
        if not len(points):
            return self
        return Scan(
            self.origin,
            np.concatenate((self.ends, points)),
            np.concatenate((self.hits, np.ones(len(points), bool))),
            np.concatenate((self.begins, np.repeat(self.origin[None], len(points), axis=0))),
            self.added + len(points),
        )

    @property
    def points(self) -> np.ndarray:
        """What was hit, shape (m, 2) [m]."""
        points: np.ndarray = self.ends[self.hits]
        return points

    @property
    def own_points(self) -> np.ndarray:
        """What the lidar's own rays have hit, in their order, shape (m, 2) [m]."""
        own = len(self.ends) - self.added
        points: np.ndarray = self.ends[:own][self.hits[:own]]
        return points


class Ranges(NamedTuple):
    """A lidar's rays, with the names of sensor_msgs/LaserScan [m], [rad]."""

    ranges: Sequence[float]
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    time_increment: float = 0.0  # from one ray to the next [s]

    @property
    def times(self) -> np.ndarray:
        """
        Time of each ray since the first [s], shape (n,).

        Raises:
            InvalidMessage: no lidar takes so long, or more rays than any lidar has.
        """
        count = len(self.ranges)
        if count > MOST_RAYS:
            raise InvalidMessage(f'wanted at most {MOST_RAYS} rays, got {count}')
        if not 0.0 <= self.time_increment * count <= LONGEST_SWEEP:
            raise InvalidMessage(
                f'wanted rays within {LONGEST_SWEEP:g} s of one another, got a time_increment of '
                f'{self.time_increment} s with {count} of them'
            )
        return self.time_increment * np.arange(count)


def read_ranges(
    said: Ranges,
    mount: Pose,
    moved: np.ndarray | None = None,
    is_ground: IsGround | None = None,
) -> Scan:
    """
    Return the rays of a lidar; `mount` is its pose in the level frame below the base.

    `moved`, shape (n, 3), is where the base was at each ray, as seen from where it is at the
    scan's instant; else it stood still. `is_ground` says in that frame which rays end on ground.

    Raises:
        InvalidMessage: its angles or limits are not finite, or no ray tells anything: it is blind.
    """
    numbers = said[1:5]
    if not all(map(math.isfinite, numbers)) or not said.range_max > 0.0:
        raise InvalidMessage(
            'wanted finite angles and limits, the greatest range above 0 m; angle_min, '
            f'angle_increment, range_min and range_max are {", ".join(map(str, numbers))}'
        )
    ranges = np.array(said.ranges, dtype=float)
    angles = said.angle_min + said.angle_increment * np.arange(len(ranges))
    limits = said.range_min, said.range_max
    scan = read_scan(ranges, angles, limits, mount, moved, is_ground)
    if not len(scan.ends):
        raise InvalidMessage('the lidar is blind, no ray tells anything')
    return scan


def read_scan(
    ranges: np.ndarray,
    angles: np.ndarray,
    limits: tuple[float, float],
    mount: Pose = LEVEL,
    moved: np.ndarray | None = None,
    is_ground: IsGround | None = None,
) -> Scan:
    """
    Return the rays that a sensor_msgs/LaserScan tells of (REP 117), as seen from above.

    `ranges` [m] and `angles` [rad], shape (n,); `limits` are the least and the greatest range
    [m]. Ranges beyond the greatest are of rays that hit nothing up to there, or up to FREE_SIGHT;
    those below the least, 0 and NaN tell nothing. Nor do rays that end on the floor, or on ground.

    `mount` is the lidar's pose in a level frame below the base: its origin is at the height of
    the floor, x is ahead. `moved`, `is_ground`: see `read_ranges`.
    """
    least, most = max(limits[0], NEAREST), limits[1]
    tells = (ranges >= least) & ~_is_lost(ranges, least, min(most, HORIZON))
    ranges, angles = ranges[tells], angles[tells]
    along = np.stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)), axis=1)
    along = along @ mount.rotation.T
    hits = ranges <= min(most, HORIZON)
    lengths = np.where(hits, ranges, min(most, FREE_SIGHT))
    is_floor = -lengths * along[:, 2] >= max(mount.position[2] - FLOOR, LEAST_DESCENT)
    origin = mount.position[:2].copy()
    ends = origin + lengths[:, None] * along[:, :2]
    begins = np.repeat(origin[None], len(ends), axis=0)
    if moved is not None:
        begins, ends = _carry(moved[tells], begins), _carry(moved[tells], ends)
    heights = mount.position[2] + lengths * along[:, 2]
    if is_ground is not None:
        is_floor |= hits & is_ground(begins, np.column_stack((ends, heights)))
    left = ~is_floor
    return Scan(origin, ends[left], hits[left], begins[left], heights=heights[left])


def _carry(poses: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points, shape (n, 2), each of its own frame, whose poses have shape (n, 3)."""
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x, y = points.T
    return np.stack((poses[:, 0] + cos * x - sin * y, poses[:, 1] + sin * x + cos * y), axis=1)


def _is_lost(ranges: np.ndarray, least: float, most: float) -> np.ndarray:
    """
    Return which rays only seem to hit nothing, shape (n,).

    A lidar reports a lost echo as free space. But no gap is so narrow that only one or two rays
    pass between others that hit. Rays beyond the scan's ends are unknown.
    """
    nothing, has_echo = np.isposinf(ranges), (least <= ranges) & (ranges <= most)
    beside = np.pad(has_echo, 1, constant_values=has_echo.any())
    steps = np.diff(np.pad(nothing, 1).astype(np.int8))
    begins, ends = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)
    lost = np.zeros(len(ranges), dtype=np.bool_)
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        if end - begin <= MOST_LOST:
            lost[begin:end] = beside[begin] and beside[end + 1]
    return lost
