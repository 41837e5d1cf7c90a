# SPDX-License-Identifier: Apache-2.0
"""Where the robot is in a map that is there already."""

import math

import numpy as np

from wasd_navigation.grid import Grid
from wasd_navigation.mapping.growth import add_covariance
from wasd_navigation.mapping.growth import LEAP
from wasd_navigation.mapping.growth import OdometryGrowth
from wasd_navigation.mapping.hypotheses import Hypotheses
from wasd_navigation.mapping.hypotheses import PRIOR
from wasd_navigation.mapping.local_map import Fit
from wasd_navigation.mapping.local_map import fit_scan
from wasd_navigation.mapping.matrices import invert
from wasd_navigation.mapping.search import Pyramid
from wasd_navigation.mapping.search import Search
from wasd_navigation.mapping.search import STEP
from wasd_navigation.mapping.search import Window
from wasd_navigation.mapping.search import window_around
from wasd_navigation.mapping.surface import find_surface
from wasd_navigation.mapping.surface import make_grid_map
from wasd_navigation.parameters import MappingParameters
from wasd_navigation.scan import Scan
from wasd_navigation.se2 import compose
from wasd_navigation.se2 import inverse

ROUNDS = 12
# What a fit tells is believed by this share: its errors are not independent.
TRUST = 0.1
# A scan of which a smaller share fits speaks against the pose; so many in a row are enough.
LEAST_SHARE, MOST_MISFITS = 0.55, 4
# When by so much less of a scan fits than of those before, as often, all of the map is searched
# for where by half of that more fits; by this share a scan what has fitted before is forgotten.
SUDDEN, FORGOTTEN = 0.1, 0.05
# A pose that was said is searched around so far at least [m], [rad], and so many deviations.
LEAST_REACH, LEAST_TURN, DEVIATIONS = 0.75, 0.8, 2.0


class Localizer:
    """
    Keeps a grid, the robot's pose in it, and while that is not known, where it may be.

    It searches the whole map at first, when it is told a pose only around that, and again when
    scans have ceased to fit: then the robot was moved by hand. When they suddenly fit less it may
    have been: then it keeps its pose until a better one is found.
    """

    def __init__(self, grid: Grid, parameters: MappingParameters | None = None) -> None:
        self.grid = grid
        self._parameters = parameters or MappingParameters()
        self._surfaces = make_grid_map(grid)
        self._pyramid = Pyramid(grid)
        # Cells are coarser than ranges.
        self._noise = math.hypot(self._parameters.range_noise, 0.3 * grid.resolution)
        self.revision = 0
        self.closures = 0
        self._misfits = 0
        self._search: Search | None = None
        self._moved = np.zeros(3)  # since the search began
        # How much of a scan fits as a rule, and how many in a row have fitted less.
        self._usual, self._drops = 0.0, 0
        self.reset()

    def reset(self) -> None:
        """Forget where the robot is, and search for it everywhere."""
        self._growth = OdometryGrowth()
        self.pose = np.zeros(3)
        self.covariance: np.ndarray = np.diag((1e2, 1e2, 10.0))
        self.correction = np.zeros(3)
        self.notice: str | None = None
        self._lose(None)

    def start(self, pose: np.ndarray, covariance: np.ndarray) -> None:
        """Believe that the robot is near a pose in the map, shape (3,), by a covariance (3, 3)."""
        self.pose = np.array(pose, dtype=float)
        spread = DEVIATIONS * np.sqrt(np.clip(np.diag(covariance), 0.0, 1e4))
        reach = np.maximum(spread[:2], LEAST_REACH)
        self._lose(window_around(self.pose, reach, max(float(spread[2]), LEAST_TURN)))
        self.notice = None

    @property
    def is_found(self) -> bool:
        """Whether it is known where the robot is."""
        return self._hypotheses is None

    def step(self, scan: Scan, odometry: np.ndarray, covariance: np.ndarray) -> None:
        """
        Take in a scan, and the pose and covariance of the base in the odom frame at its stamp.

        What is not finite is not taken in.
        """
        if not (np.isfinite(odometry).all() and np.isfinite(covariance).all()):
            return
        surface = find_surface(scan).points
        move, growth = self._growth.step(odometry, covariance)
        self.covariance = add_covariance(self.covariance, self.pose, move, growth)
        self.pose = compose(self.pose, move)
        if self._hypotheses is None:
            self._follow(scan, surface, move)
        else:
            self._search_on(scan, surface, move)
        self.correction = compose(self.pose, inverse(odometry))

    def take_leap(self, before: np.ndarray, after: np.ndarray) -> None:
        """Stay in place while the pose in the odom frame is another from now on, shapes (3,)."""
        self._growth = OdometryGrowth()
        self.covariance = self.covariance + LEAP
        self.correction = compose(compose(self.correction, before), inverse(after))

    def _fit(self, surface: np.ndarray, start: np.ndarray, prior: np.ndarray) -> Fit:
        return Fit(*fit_scan(self._surfaces, surface, start, prior, self._noise, ROUNDS))

    def _follow(self, scan: Scan, surface: np.ndarray, move: np.ndarray) -> None:
        """Correct the pose by a scan, or doubt it."""
        if self._search is not None:
            self._moved = compose(self._moved, move)
        prior = invert(self.covariance)
        fit = self._fit(surface, self.pose, prior)
        if fit.share < LEAST_SHARE:
            self._misfits += 1
            if self._misfits >= MOST_MISFITS:
                self._say_moved(fit.share)
            return
        self._misfits = 0
        self.pose = fit.pose
        self.covariance = invert(prior + TRUST * fit.information)
        self._compare(scan, surface, fit.share)

    def _compare(self, scan: Scan, surface: np.ndarray, share: float) -> None:
        """See whether suddenly less fits, and if so, whether more does anywhere else."""
        self._usual += FORGOTTEN * (share - self._usual)
        self._drops = self._drops + 1 if share < self._usual - SUDDEN else 0
        if self._search is None:
            if self._drops >= MOST_MISFITS:
                self.notice = (
                    f'may have been moved by hand: {100 * share:.0f} % of what the lidar sees '
                    f'fits the map, before it was {100 * self._usual:.0f} %'
                )
                self._search = Search(self._pyramid, scan.points, self._everywhere())
                self._moved = np.zeros(3)
            return
        if not self._search.work() or self._search.found is None:
            return
        poses, self._search, self.notice = self._search.found.poses, None, None
        self._usual = share
        for pose in poses[:1]:
            if self._fit(surface, compose(pose, self._moved), PRIOR).share > share + 0.5 * SUDDEN:
                self._say_moved(share)

    def _say_moved(self, share: float) -> None:
        self._lose(None)
        self.notice = (
            f'was moved by hand: {100 * share:.0f} % of what the lidar sees fits '
            'the map; searching all of it'
        )

    def _everywhere(self) -> Window:
        pyramid = self._pyramid
        return Window(pyramid.low, pyramid.high, -math.pi, round(2.0 * math.pi / STEP))

    def _lose(self, window: Window | None) -> None:
        """Search a window, or everywhere."""
        self._misfits = 0
        self._is_near = window is not None
        self._window = window or self._everywhere()
        self._search = None
        self._hypotheses: Hypotheses | None = Hypotheses()

    def _search_on(self, scan: Scan, surface: np.ndarray, move: np.ndarray) -> None:
        """Search a little, or see which of the poses found goes on to fit."""
        assert self._hypotheses is not None
        if self._search is None:
            self._search = Search(self._pyramid, scan.points, self._window)
            self._moved = np.zeros(3)
        else:
            self._moved = compose(self._moved, move)
        if not len(self._hypotheses):
            if not self._search.work() or self._search.found is None:
                return
            self._hypotheses.take(self._search.found, self._moved)
        else:
            self._hypotheses.move(move)
        self._hypotheses.judge(self._fit, surface)
        best = self._hypotheses.best()
        if best is None:
            # Nothing fits: what was seen may not be in the map, or the window was wrong.
            self._lose(None)
            return
        self.pose = best.pose
        if self._hypotheses.is_decided(self._is_near):
            self.covariance = invert(TRUST * best.information + 1e-3 * np.eye(3))
            self._hypotheses, self._search = None, None
            self._usual, self._drops = best.share, 0
            self.notice = None
        elif len(self._hypotheses) > 1:
            self.notice = f'may be at {len(self._hypotheses)} places: drive on to tell them apart'
