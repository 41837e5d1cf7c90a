# SPDX-License-Identifier: Apache-2.0
"""Localises in a saved map, with hypotheses until one is left."""

from collections.abc import Callable
from dataclasses import dataclass
import math

import numpy as np

from wasd_navigation.mapping.contradictions import Contradictions
from wasd_navigation.mapping.grid_surfaces import make_grid_map
from wasd_navigation.mapping.local_map import Fit, fit_scan
from wasd_navigation.mapping.search import Found, Pyramid, Search, Window, window_around
from wasd_navigation.mapping.surface import find_surface, RangeNoise
from wasd_navigation.mapping.tracker import ROUNDS, STUCK, Tracker, TRUST
from wasd_navigation.parameters import MappingParameters
from wasd_navigation.records import Grid, Scan
from wasd_navigation.se2 import compose, inverse, invert, wrap

# At most so many are looked at, these far apart at least [m], [rad].
MOST, APART, TURNED = 8, 0.4, 0.3
# The pose of one is known so well: standard deviations [m], [rad].
PRIOR = np.diag((1.0 / 0.15**2, 1.0 / 0.15**2, 1.0 / 0.06**2))
# One is given up when by so much, in sum, more of the scans is contradicted than with the best of
# them, after what is allowed for each [Page1954]; or when less than this fits at all. Of none more
# than this share is believed to be of people and of what was moved: then the best is wrong, too.
WORSE, ALLOWED, LEAST, CHANGED = 0.5, 0.03, 0.55, 0.15
# Scans that the last one left, or one that was asked for, must have fitted.
SCANS = 3
# A scan of which a smaller share fits speaks against the pose; so many in a row are enough.
LEAST_SHARE, MOST_MISFITS = 0.55, 8
# A scan does not speak against the pose if this share fits and the map contradicts at most that
# share: the rest lies where the map knows nothing.
LEAST_KNOWN, NOT_AGAINST = 0.25, 0.05
# After so many, or when suddenly less fits, it is searched for around its pose [m], [rad]: wheels
# slip, and robots are pushed.
PUSHED, PUSH, PUSH_TURN = 2, 0.6, 0.5
# A robot that is found this far from where odometry has it was moved by hand, no wheels slip so
# far between two scans [m], [rad]: that is said for so many scans.
FAR, FAR_TURN, SAID = 0.3, 0.3, 8
# When by so much less of a scan fits than of those before, as often, all of the map is searched
# for where by half of that more fits; by this share a scan what has fitted before is forgotten.
SUDDEN, FORGOTTEN = 0.1, 0.05
# A pose that was said is searched around so far at least [m], [rad], and so many deviations.
LEAST_REACH, LEAST_TURN, DEVIATIONS = 0.75, 0.8, 2.0


@dataclass
class Hypothesis:
    """A pose, how much of the last scan fits and is contradicted there, and the sum of that."""

    pose: np.ndarray
    share: float
    deficit: float
    information: np.ndarray
    scans: int = 0
    against: float = 0.0


class Hypotheses:
    """Some poses, the best first; each `judge` drops those that fit worse."""

    def __init__(self) -> None:
        self._all: list[Hypothesis] = []

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._all)

    def take(self, found: Found, moved: np.ndarray) -> None:
        """Begin with what a search has found, from where the robot has moved since."""
        for pose, score in zip(found.poses, found.scores, strict=True):
            if len(self._all) == MOST:
                break
            if not any(_is_near(pose, other.pose) for other in self._all):
                self._all.append(Hypothesis(pose, float(score), 0.0, np.zeros((3, 3))))
        self.move(moved)

    def move(self, move: np.ndarray) -> None:
        """Move all as the robot has moved."""
        for each in self._all:
            each.pose = compose(each.pose, move)

    def judge(
        self, fit: Callable[[np.ndarray], Fit], contradicted: Callable[[np.ndarray], float]
    ) -> None:
        """See how a scan fits at each, and what share of it the map contradicts there."""
        for each in self._all:
            fitted = fit(each.pose)
            each.pose, each.information = fitted.pose, fitted.information
            each.share, each.against = fitted.share, contradicted(fitted.pose)
            each.scans += 1
        least = min((each.against for each in self._all), default=0.0)
        least = min(least, CHANGED)
        for each in self._all:
            each.deficit = max(0.0, each.deficit + each.against - least - ALLOWED)
        self._all.sort(key=lambda each: (each.deficit, -each.share))
        kept: list[Hypothesis] = []
        for each in self._all:
            is_worse = each.deficit > WORSE or (each.share < LEAST and each.scans > 1)
            if not is_worse and not any(_is_near(each.pose, other.pose) for other in kept):
                kept.append(each)
        self._all = kept

    def best(self) -> Hypothesis | None:
        """Return the one that fits best."""
        return self._all[0] if self._all else None

    def is_decided(self, was_told: bool) -> bool:
        """Whether one is left that is not about to go, or the robot was told where it is."""
        best = self._all[0]
        is_last = len(self._all) == 1 and best.deficit <= 0.5 * WORSE
        return (is_last or was_told) and best.scans >= SCANS


def _is_near(first: np.ndarray, second: np.ndarray) -> bool:
    away = math.hypot(first[0] - second[0], first[1] - second[1])
    return away < APART and abs(wrap(first[2] - second[2])) < TURNED


class Localizer:
    """
    Keeps a grid, the robot's pose in it, and candidates while the pose is unknown.

    It searches the whole map at first, when it is told a pose only around that, and again when
    scans have ceased to fit: then the robot was moved by hand. When they suddenly fit less it may
    have been: then it keeps its pose until a better one is found.
    """

    def __init__(self, grid: Grid, parameters: MappingParameters | None = None) -> None:
        self.grid = grid
        self._parameters = parameters or MappingParameters()
        self._surfaces = make_grid_map(grid)
        self._pyramid = Pyramid(grid)
        self._ranges = RangeNoise(self._parameters.range_noise, self._parameters.range_noise_share)
        # Cells are coarser than ranges.
        self._noise = math.hypot(self._parameters.range_noise, 0.3 * grid.resolution)
        self._contradictions = Contradictions(grid, self._surfaces, self._noise)
        self._tracker = Tracker(self._noise)
        self.revision = 0
        self._misfits = 0
        self._search: Search | None = None
        self._near: Search | None = None  # around the pose
        self._pushed = 0  # scans in a row that fit less than before
        self._said = 0  # scans for which it is still to be said that it was moved
        # How much of a scan fits as a rule, and how many in a row have fitted less.
        self._usual, self._drops = 0.0, 0
        self.reset()

    def reset(self) -> None:
        """Forget where the robot is, and search for it everywhere."""
        self._tracker.reset()
        self._tracker.put(np.zeros(3), np.diag((1e2, 1e2, 10.0)))
        self.correction = np.zeros(3)
        self._words: str | None = None
        self._lose(None)

    def start(self, pose: np.ndarray, covariance: np.ndarray) -> None:
        """Believe that the robot is near a pose in the map, shape (3,), by a covariance (3, 3)."""
        self._tracker.put(pose, self.covariance)
        spread = DEVIATIONS * np.sqrt(np.clip(np.diag(covariance), 0.0, 1e4))
        reach = np.maximum(spread[:2], LEAST_REACH)
        self._lose(window_around(self.pose, reach, max(float(spread[2]), LEAST_TURN)))
        self._words = None

    @property
    def pose(self) -> np.ndarray:
        """T_map_base at the last scan, shape (3,)."""
        return self._tracker.pose

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the pose in the map's axes, shape (3, 3)."""
        return self._tracker.covariance

    @property
    def is_found(self) -> bool:
        """Whether it is known where the robot is."""
        return self._hypotheses is None

    @property
    def is_stuck(self) -> bool:
        """Whether the wheels turn and the robot does not come along."""
        return self.is_found and self._tracker.is_stuck

    @property
    def notice(self) -> str | None:
        """A message to the driver; None if all is well."""
        return self._words or (STUCK if self.is_stuck else None)

    def step(self, scan: Scan, odometry: np.ndarray, covariance: np.ndarray) -> None:
        """
        Take in a scan, and the pose and covariance of the base in the odom frame at its stamp.

        It ignores values that are not finite.
        """
        if not (np.isfinite(odometry).all() and np.isfinite(covariance).all()):
            return
        surface = find_surface(scan, self._ranges.step(scan)).points
        move = self._tracker.move(odometry, covariance)
        if self._hypotheses is None:
            self._follow(scan, surface, move)
        else:
            self._search_on(scan, surface, move)
        self.correction = compose(self.pose, inverse(odometry))

    def take_leap(self, before: np.ndarray, after: np.ndarray) -> None:
        """Stay in place while the pose in the odom frame is another from now on, shapes (3,)."""
        self._tracker.leap()
        self.correction = compose(compose(self.correction, before), inverse(after))

    def _fit(self, surface: np.ndarray, start: np.ndarray, prior: np.ndarray) -> Fit:
        return Fit(*fit_scan(self._surfaces, surface, start, prior, self._noise, ROUNDS))

    def _follow(self, scan: Scan, surface: np.ndarray, move: np.ndarray) -> None:
        """Correct the pose by a scan, or doubt it."""
        if self._search is not None:
            self._search.moved = compose(self._search.moved, move)
        if self._said:
            self._said -= 1
            self._words = self._words if self._said else None
        fit = self._tracker.fit(self._surfaces, surface)
        is_less = fit.share < max(LEAST_SHARE, self._usual - SUDDEN)
        self._pushed = self._pushed + 1 if is_less else 0
        if self._pushed >= PUSHED and self._seek(scan, surface, move, fit.share):
            return
        if fit.share < LEAST_SHARE and not self._is_beyond_map(scan, surface, fit):
            self._misfits += 1
            if self._misfits >= MOST_MISFITS:
                self._say_moved(fit.share)
            return
        self._misfits = 0
        self._say_leap(fit.pose)
        self._tracker.believe(fit)
        self._compare(scan, surface, fit.share)

    def _is_beyond_map(self, scan: Scan, surface: np.ndarray, fit: Fit) -> bool:
        """Whether the points of a scan that do not fit lie in unknown cells."""
        if fit.share < LEAST_KNOWN:
            return False
        return self._contradictions.share(surface, scan.origin, fit.pose) <= NOT_AGAINST

    def _seek(self, scan: Scan, surface: np.ndarray, move: np.ndarray, share: float) -> bool:
        """Search a little around where it is believed to be; return whether it is elsewhere."""
        if self._near is None:
            window = window_around(self.pose, np.full(2, PUSH), PUSH_TURN)
            self._near = Search(self._pyramid, scan.points, window)
        else:
            self._near.moved = compose(self._near.moved, move)
        if not self._near.work() or self._near.found is None:
            return False
        (poses, _), moved, self._near = self._near.found, self._near.moved, None
        for pose in poses[:1]:
            fit = self._fit(surface, compose(pose, moved), PRIOR)
            # As much as before fits, or far more than here and the map contradicts none of it.
            enough = self._usual - SUDDEN
            if fit.share > share + 2.0 * SUDDEN and self._is_beyond_map(scan, surface, fit):
                enough = LEAST_SHARE
            if fit.share > max(LEAST_SHARE, enough, share + 0.5 * SUDDEN):
                self._search, self._words, self._said = None, None, 0
                self._say_leap(fit.pose)
                self._tracker.put(fit.pose, invert(PRIOR + TRUST * fit.information))
                self._misfits = self._pushed = self._drops = 0
                return True
        return False

    def _say_leap(self, pose: np.ndarray) -> None:
        """Say so if the robot is far from where odometry has it."""
        off = pose - self.pose
        away, turned = math.hypot(off[0], off[1]), abs(wrap(off[2]))
        if away > FAR or turned > FAR_TURN:
            self._said = SAID
            self._words = (
                f'was moved by hand, by {away:.2f} m and {math.degrees(turned):.0f} degrees: '
                'goes on from there'
            )

    def _compare(self, scan: Scan, surface: np.ndarray, share: float) -> None:
        """See whether suddenly less fits, and if so, whether more does anywhere else."""
        self._usual += FORGOTTEN * (share - self._usual)
        self._drops = self._drops + 1 if share < self._usual - SUDDEN else 0
        if self._drops == 0:
            self._near = None
        if self._search is None:
            if self._drops >= MOST_MISFITS:
                self._words = (
                    f'may have been moved by hand: {100 * share:.0f} % of what the lidar sees '
                    f'fits the map, before it was {100 * self._usual:.0f} %'
                )
                self._search = Search(self._pyramid, scan.points, self._pyramid.everywhere)
            return
        if not self._search.work() or self._search.found is None:
            return
        (poses, _), moved = self._search.found, self._search.moved
        self._search = self._words = None
        self._usual = share
        for pose in poses[:1]:
            if self._fit(surface, compose(pose, moved), PRIOR).share > share + 0.5 * SUDDEN:
                self._say_moved(share)

    def _say_moved(self, share: float) -> None:
        self._lose(None)
        self._words = (
            f'was moved by hand: {100 * share:.0f} % of what the lidar sees fits '
            'the map; searching all of it'
        )

    def _lose(self, window: Window | None) -> None:
        """Search a window, or everywhere."""
        self._misfits = self._pushed = self._said = 0
        self._near = None
        self._is_near = window is not None
        self._window = window or self._pyramid.everywhere
        self._search = None
        self._hypotheses: Hypotheses | None = Hypotheses()

    def _search_on(self, scan: Scan, surface: np.ndarray, move: np.ndarray) -> None:
        """Search a little, or see which of the poses found goes on to fit."""
        assert self._hypotheses is not None
        if self._search is None:
            self._search = Search(self._pyramid, scan.points, self._window)
        else:
            self._search.moved = compose(self._search.moved, move)
        if not len(self._hypotheses):
            if not self._search.work() or self._search.found is None:
                return
            self._hypotheses.take(self._search.found, self._search.moved)
        else:
            self._hypotheses.move(move)
        self._hypotheses.judge(
            lambda pose: self._fit(surface, pose, PRIOR),
            lambda pose: self._contradictions.share(surface, scan.origin, pose),
        )
        best = self._hypotheses.best()
        if best is None:
            # Nothing fits: what was seen may not be in the map, or the window was wrong.
            self._lose(None)
            self._words = None
            return
        self._tracker.pose = best.pose
        if self._hypotheses.is_decided(self._is_near):
            known = TRUST * best.information + 1e-3 * np.eye(3)
            self._tracker.put(best.pose, invert(known))
            self._hypotheses, self._search = None, None
            self._usual, self._drops = best.share, 0
            self._words = None
            return
        count = len(self._hypotheses)
        self._words = (
            f'may be at {count} places: drive on to tell them apart' if count > 1 else None
        )
