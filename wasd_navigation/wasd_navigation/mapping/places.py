# SPDX-License-Identifier: Apache-2.0
"""Places that a mapping robot has been to, what it saw there, and the grid drawn of them."""

from dataclasses import dataclass, field

import numpy as np

from wasd_navigation.mapping.local_map import add_surfaces, LocalMap
from wasd_navigation.mapping.occupancy import Canvas
from wasd_navigation.mapping.pose_graph import Edges
from wasd_navigation.mapping.surface import find_surface, Noise, Surface
from wasd_navigation.records import Grid, Scan
from wasd_navigation.se2 import compose, inverse, invert, sandwich, turn_axes, wrap

# So many places are drawn in one step.
PORTION = 2
# One in so many rows and columns tells how much is known.
SOME = 4
# Places that have moved less are not drawn again [m], [rad].
LEAST_MOVE, LEAST_TURN = 0.01, 0.004
# How well is known where a place lies in the one that it is merged into: variances [m^2], [rad^2].
MERGED = np.diag((0.003**2, 0.003**2, 0.0015**2))
SLIGHT = np.diag((1.0, 1.0, 1.0))  # information: a metre, a radian
NO_POINTS = np.empty((0, 5), np.float32)


@dataclass
class Places:
    """
    Nodes of the pose graph with what was seen there, and its edges: one of a pair at most.

    What was seen is kept in half the memory that it takes to compute with it. A place that was
    merged into another one is only where it lies in that one, and no node any more.
    """

    _scans: list[Scan | None] = field(default_factory=list)
    _points: list[np.ndarray] = field(default_factory=list)
    # Itself, or the place that it was merged into, and where it lies in that one.
    _into: np.ndarray = field(default_factory=lambda: np.zeros(64, np.int64))
    _offsets: np.ndarray = field(default_factory=lambda: np.zeros((64, 3)))
    _held: np.ndarray | None = None
    visits: list[int] = field(default_factory=list)  # how often each has been seen
    _poses: np.ndarray = field(default_factory=lambda: np.zeros((64, 3)))
    _count: int = 0  # of edges
    _edges: Edges = field(
        default_factory=lambda: Edges(
            np.zeros((64, 2), dtype=np.int64),
            np.zeros((64, 3)),
            np.zeros((64, 3, 3)),
            np.zeros(64, dtype=np.bool_),
        )
    )

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._scans)

    @property
    def poses(self) -> np.ndarray:
        """Where they are in the map, shape (n, 3); may be written."""
        poses: np.ndarray = self._poses[: len(self)]
        return poses

    @property
    def held(self) -> np.ndarray:
        """The numbers of those that were merged into no other, shape (m,)."""
        if self._held is None:
            self._held = np.flatnonzero(self._into[: len(self)] == np.arange(len(self)))
        return self._held

    def add(self, scan: Scan, surface: Surface, pose: np.ndarray) -> None:
        """Add a place."""
        number = len(self)
        if number == len(self._poses):
            self._poses, self._into = _grown(self._poses), _grown(self._into)
            self._offsets = _grown(self._offsets)
        self._poses[number] = pose
        self._scans.append(_in_type(scan, np.float32))
        self._points.append(surface.points.astype(np.float32))
        self._into[number] = number
        self._held = None
        self.visits.append(1)

    def scan(self, number: int) -> Scan | None:
        """Return what is drawn of a place; None of one that was merged."""
        scan = self._scans[number]
        return None if scan is None else _in_type(scan, np.float64)

    def draw(self, number: int, scan: Scan) -> None:
        """Draw another scan of a place from now on."""
        self._scans[number] = _in_type(scan, np.float32)

    def points(self, number: int) -> np.ndarray:
        """Return what scans are matched against: as `Surface.points`."""
        return self._points[number].astype(np.float64)

    def link(self, pair: tuple[int, int], pose: np.ndarray, known: np.ndarray, sure: bool) -> None:
        """
        Add that the second has a pose in the first's frame, with an information (3, 3).

        What is known of a pair already is kept: one edge has the mean of both.
        """
        row = self._row(pair)
        if row < self._count:
            before = self._edges.informations[row]
            step = pose - self._edges.poses[row]
            step[2] = wrap(step[2])
            known = before + known
            pose = self._edges.poses[row] + np.linalg.pinv(known) @ (known - before) @ step
            sure = sure or not self._edges.robust[row]
        else:
            self._count += 1
            if row == len(self._edges.pairs):
                self._edges = Edges(*map(_grown, self._edges))
        for kept, value in zip(self._edges, (pair, pose, known, not sure), strict=True):
            kept[row] = value

    def _row(self, pair: tuple[int, int]) -> int:
        """Return the row of an edge; that after the last one if there is none."""
        first, second = self._edges.pairs[: self._count].T
        rows = np.flatnonzero((first == pair[0]) & (second == pair[1]))
        return int(rows[0]) if len(rows) else self._count

    def merge(self, number: int, into: int) -> None:
        """
        Merge a place into an older one, which has its links and is drawn as it is from now on.

        How the two lie is as good as known.
        """
        offset = compose(inverse(self._poses[into]), self._poses[number])
        scan = self._scans[number]
        assert scan is not None
        self.draw(into, _in_type(scan, np.float64).seen_from(offset))
        self._scans[number], self._points[number], self._held = None, NO_POINTS, None
        for other in np.flatnonzero(self._into[: len(self)] == number):
            self._into[other] = into
            self._offsets[other] = compose(offset, self._offsets[other])
        pairs = self._edges.pairs[: self._count]
        for pair in map(tuple, pairs[(pairs == number).any(axis=1)].tolist()):
            pose, known, robust = self._unlink(pair)
            if into in pair:
                continue
            arm = np.eye(3)
            if pair[0] == number:
                moved, yaw, pair = compose(offset, pose), float(offset[2]), (into, pair[1])
            else:
                moved, yaw, pair = compose(pose, inverse(offset)), 0.0, (pair[0], into)
                arm[:2, 2] = pose[1] - moved[1], moved[0] - pose[0]
            self.link(pair, moved, _moved(known, arm, yaw), not robust)

    def _unlink(self, pair: tuple[int, int]) -> tuple[np.ndarray, np.ndarray, bool]:
        """Remove an edge; return its pose, information and whether it may be wrong."""
        self._count -= 1
        row, edges = self._row(pair), self._edges
        removed = edges.poses[row].copy(), edges.informations[row].copy(), bool(edges.robust[row])
        for kept in edges:
            kept[row] = kept[self._count]
        return removed

    def follow(self) -> None:
        """Let those that were merged lie where they do in the others, which have moved."""
        numbers = np.flatnonzero(self._into[: len(self)] != np.arange(len(self)))
        offsets, roots = self._offsets[numbers], self._poses[self._into[numbers]]
        cos, sin = np.cos(roots[:, 2]), np.sin(roots[:, 2])
        self._poses[numbers, 0] = roots[:, 0] + cos * offsets[:, 0] - sin * offsets[:, 1]
        self._poses[numbers, 1] = roots[:, 1] + sin * offsets[:, 0] + cos * offsets[:, 1]
        turned = roots[:, 2] + offsets[:, 2]
        self._poses[numbers, 2] = (turned + np.pi) % (2.0 * np.pi) - np.pi

    def join(self, number: int, points: np.ndarray, pose: np.ndarray, local: LocalMap) -> None:
        """
        Join points seen from a pose in a place's frame with the known points there.

        Each cell of `local`, which is written, has the mean of both, known as well as both.
        """
        local.clear(np.zeros(2))
        known = self._points[number]
        both = np.concatenate((known, points), dtype=np.float64)
        begins = np.array((0, len(known), len(both)))
        add_surfaces(local, np.array((np.zeros(3), pose)), both, begins)
        sums = local.sums[: local.used[0]]
        joined = np.column_stack((sums[:, 1:], 1.0 / np.sqrt(sums[:, 0])))
        self._points[number] = joined.astype(np.float32)
        self.visits[number] += 1

    def edges(self) -> Edges:
        """Return all that is known of pairs, which are numbers in `held`."""
        edges = Edges(*(kept[: self._count].copy() for kept in self._edges))
        return edges._replace(pairs=np.searchsorted(self.held, edges.pairs))

    def show(self, local: LocalMap, middle: np.ndarray, numbers: np.ndarray) -> None:
        """Draw into a local map what was seen from some of them, around a place [m]."""
        local.clear(middle)
        seen = [self._points[number] for number in numbers]
        begins = np.cumsum([0, *map(len, seen)])
        both = np.concatenate(seen, dtype=np.float64)
        add_surfaces(local, self._poses[numbers], both, begins)


def _moved(known: np.ndarray, arm: np.ndarray, yaw: float) -> np.ndarray:
    """
    Return the information of an edge, one end of which has become another place, shape (3, 3).

    `arm` takes errors of the old pose to those of the new one, in axes that are then turned.
    """
    back = 2.0 * np.eye(3) - arm  # its inverse
    known = turn_axes(sandwich(back.T.copy(), known), yaw)
    return invert(invert(known + SLIGHT) + MERGED)


def _in_type(scan: Scan, kind: type[np.floating]) -> Scan:
    """Return a scan with numbers of another type."""
    return Scan(
        scan.origin.astype(kind),
        scan.ends.astype(kind),
        scan.hits,
        scan.begins.astype(kind),
        scan.added,
    )


def _grown(kept: np.ndarray) -> np.ndarray:
    """Return an array with a quarter more rows, which are 0."""
    return np.concatenate((kept, np.zeros_like(kept[: len(kept) // 4])))


class Drawing:
    """
    Keeps a finished canvas, and while places are drawn again a second one.

    `revision` counts changes of the finished one.
    """

    def __init__(self, resolution: float) -> None:
        self._resolution = resolution
        self.revision = 0
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._canvas, self._next = Canvas(self._resolution), Canvas(self._resolution)
        self._where, self._next_where = np.zeros((0, 3)), np.zeros((0, 3))
        self._is_redrawing = False
        self._grid: tuple[int, Grid] | None = None
        self.revision += 1

    @property
    def grid(self) -> Grid:
        """What is known of each cell."""
        if self._grid is None or self._grid[0] != self.revision:
            self._grid = self.revision, self._canvas.grid()
        return self._grid[1]

    @property
    def odds(self) -> tuple[np.ndarray, tuple[float, int, int]]:
        """Log-odds of cells that are occupied, and their frame: see `Canvas.odds`."""
        return self._canvas.odds

    @property
    def area(self) -> float:
        """How much is known, about [m^2]."""
        some = self._canvas.odds[0][::SOME, ::SOME]
        return float(np.count_nonzero(some)) * (SOME * self._resolution) ** 2

    def add_last(self, places: Places, noise: Noise) -> None:
        """Draw the last place, seen with some noise."""
        self._where = _draw(self._canvas, self._where, places, noise, len(places))
        self.revision += 1

    def add(self, scan: Scan, surface: Surface, pose: np.ndarray) -> None:
        """Draw what is seen from a pose now."""
        self._canvas.draw(scan, surface, pose)
        self.revision += 1

    def see_moves(self, places: Places) -> None:
        """Begin to draw again if places have moved since they were drawn."""
        moved = np.abs(places.poses[: len(self._where)] - self._where)
        if not self._is_redrawing and (moved > (LEAST_MOVE, LEAST_MOVE, LEAST_TURN)).any():
            self._is_redrawing = True
            self._next.clear()
            self._next_where = np.zeros((0, 3))

    def work(self, places: Places, noise: Noise) -> None:
        """Draw some places again, and show them when all are drawn."""
        if not self._is_redrawing:
            return
        end = min(len(places), len(self._next_where) + PORTION)
        self._next_where = _draw(self._next, self._next_where, places, noise, end)
        if end == len(places):
            self._canvas, self._next = self._next, Canvas(self._resolution)
            self._where, self._next_where = self._next_where, np.zeros((0, 3))
            self._is_redrawing = False
            self.revision += 1


def _draw(canvas: Canvas, where: np.ndarray, places: Places, noise: Noise, end: int) -> np.ndarray:
    """Draw places up to `end` and return where all that are drawn were then."""
    poses = places.poses[len(where) : end].copy()
    for number, pose in enumerate(poses, start=len(where)):
        scan = places.scan(number)
        if scan is not None:
            canvas.draw(scan, find_surface(scan, noise), pose)
    return np.concatenate((where, poses))
