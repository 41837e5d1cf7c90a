# SPDX-License-Identifier: Apache-2.0
"""SLAM: the robot's pose in a map that grows with its scans."""

import math

import numpy as np

from wasd_navigation.mapping.comers import Comers
from wasd_navigation.mapping.local_map import count_fitting, Fit, fit_scan, make_local_map
from wasd_navigation.mapping.places import Drawing, Places, SLIGHT
from wasd_navigation.mapping.pose_graph import Solver
from wasd_navigation.mapping.search import Pyramid, Search, window_around
from wasd_navigation.mapping.session import Session
from wasd_navigation.mapping.surface import find_surface, RangeNoise, Surface
from wasd_navigation.mapping.tracker import ROUNDS, STUCK, Tracker, TRUST, WAVER
from wasd_navigation.odometry import add_covariance, LEAP
from wasd_navigation.parameters import MappingParameters
from wasd_navigation.records import Grid, Scan
from wasd_navigation.se2 import compose, inverse, invert, turn_axes, wrap

# A local map reaches as far as a scan that fits, and as far as places are from each other [m].
LOCAL_REACH = 14.0
# A scan fits when this share of what it sees lies on what is known; less is not believed. On the
# way through an unknown flat it is 0.74 at least.
LEAST_SHARE = 0.55
# If not, no place is kept, and the robot is searched for within this of where odometry says [m],
# [rad]; after so many scans in all of the map: then somebody has carried it. Fewer points tell
# nothing.
SLIP, SLIP_TURN, PATIENCE, FEWEST = 1.0, 0.8, 10, 40
# Where much is new so many points must fit what is known.
FEWEST_OF_NEW = 12
LEAST_LOOP_SHARE = 0.55
# The robot is at a known place if ENOUGH places are near: closer than this share of the distance
# that makes a new place, and turned less than SAME_TURN [rad]. This share of its scan must fit
# what is known there, and the fit may move the robot by no more than SAME_ERROR [m], [rad].
SAME_SHARE, SAME_TURN, ENOUGH, SAME_FIT = 0.8, 0.6, 3, 0.8
SAME_ERROR = np.array((0.02, 0.02, 0.01))
# It is also, whatever its heading, among MANY places within this [m] where this share fits.
KNOWN_REACH, MANY, KNOWN_FIT = 0.8, 25, 0.985
# Scans are joined with the points of a known place until it has been seen so often.
MOST_VISITS = 8
# How well the robot's pose there is known before a scan is fitted: deviations [m], [rad].
SAME_PRIOR = np.diag((1.0 / 0.03**2, 1.0 / 0.03**2, 1.0 / 0.015**2))
# So many places are kept of each square metre that is known, or in all; of more, two that are near
# each other and within this of the robot become one [1/m^2], [m].
MOST_PLACES, MOST_OF_FEW, MERGE_REACH = 2.5, 350, 3.0
# A turn between two is as far as so much way [m/rad].
SAME_ARM = 0.1
# What is seen of a place is drawn again after so many scans.
LOOK_AGAIN = 5
# What is not known of the way on which somebody has carried it [m^2], [rad^2].
CARRIED = np.diag((1e2, 1e2, 1e1))
# Loops that are off by less wait for others [m], [rad]; at most so many.
LOOP_ERROR, MOST_UNSOLVED = np.array((0.004, 0.004, 0.002)), 10
# How well a place is known before a loop is closed: standard deviations [m], [rad].
LOOP_PRIOR = np.diag((1.0 / 0.3**2, 1.0 / 0.3**2, 1.0 / 0.1**2))


class Mapper:
    """
    Keeps places with their scans, their relative poses, and the grid drawn from them.

    The first scan is taken where odometry says; the map's frame is that of odometry then. One
    `step` takes in one scan and works on loops and on the grid in small portions.
    """

    def __init__(self, parameters: MappingParameters | None = None) -> None:
        self._parameters = parameters or MappingParameters()
        self._tracker = Tracker(self._parameters.range_noise, WAVER)
        self._local = make_local_map(LOCAL_REACH)
        self._old = make_local_map(LOCAL_REACH)
        self._drawing = Drawing(self._parameters.resolution)
        self._noise = RangeNoise(self._parameters.range_noise, self._parameters.range_noise_share)
        self._comers = Comers()
        self.reset()

    grows = True  # its map grows: goals may be in unknown space

    def reset(self) -> None:
        """Forget all places; the next scan is the first."""
        self._places = Places()
        self._solver = Solver()
        self._tracker.reset()
        self._drawing.clear()
        self._noise.reset()
        self._comers.reset()
        self.correction = np.zeros(3)
        self.closures = 0
        self._since = np.zeros((3, 3))  # covariance of the pose since the last place
        self._wants_loop = False
        self._unsolved = 0
        self._solving = np.zeros(0, np.int64)  # numbers of the places that are solved for
        self._misfits = 0
        self._share = 1.0  # of the last scan that has fitted
        self._left_in = 1.0  # of the last scan's hits, without those on who has come
        self._search: Search | None = None
        self._recent: list[int] = []  # places that scans are matched against
        self._reference = 0  # the place that the robot is at, or has come from
        self._scans = 0  # since that was seen last
        self._mark = np.zeros(3)  # where the robot was in its frame when it came there

    @property
    def is_found(self) -> bool:
        """Whether it is known where the robot is."""
        return self._misfits <= PATIENCE

    @property
    def is_stuck(self) -> bool:
        """Whether the wheels turn and the robot does not come along."""
        return self._tracker.is_stuck

    @property
    def notice(self) -> str:
        """A message to the driver; '' if all is well."""
        if not self.is_found:
            return (
                f'was moved by hand: {100 * self._share:.0f} % of what the lidar sees fits the '
                'map; searching all of it, nothing is drawn meanwhile'
            )
        return STUCK if self.is_stuck else ''

    @property
    def pose(self) -> np.ndarray:
        """T_map_base at the last scan, shape (3,)."""
        return self._tracker.pose

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the pose in the map's axes, shape (3, 3)."""
        return self._tracker.covariance

    @property
    def grid(self) -> Grid:
        """What is known of the surroundings."""
        return self._drawing.grid

    @property
    def revision(self) -> int:
        """Count of changes of the grid."""
        return self._drawing.revision

    @property
    def reference(self) -> int:
        """Number of the place that the robot is at, with which its pose moves."""
        return self._reference

    @property
    def places(self) -> np.ndarray:
        """Poses of all places as they are believed now, shape (n, 3)."""
        return self._places.poses

    def step(self, scan: Scan, odometry: np.ndarray, covariance: np.ndarray) -> None:
        """
        Take in a scan, and the pose and covariance of the base in the odom frame at its stamp.

        The growth of the covariance since the last scan is that of the move. Values that are not
        finite are ignored.
        """
        if not (np.isfinite(odometry).all() and np.isfinite(covariance).all()):
            return
        first = not len(self._places)
        move = self._tracker.move(odometry, covariance)
        noise, hits = self._noise.step(scan), int(np.count_nonzero(scan.hits))
        if not self._misfits:
            scan = self._comers.leave_out(scan, self.pose, *self._drawing.odds)
        self._left_in = float(np.count_nonzero(scan.hits)) / max(hits, 1)
        surface = find_surface(scan, noise)
        if first:
            self._tracker.put(odometry, np.zeros((3, 3)))
            if len(scan.ends):  # a lidar that spins up tells nothing
                self._keep(scan, surface)
        else:
            self._follow(scan, surface, move)
            self._scans += 1
            if self._is_elsewhere():
                if not self._is_back(surface):
                    self._keep(scan, surface)
            elif self._scans > LOOK_AGAIN and not self._misfits:
                self._look_again(scan, surface)
            elif self._wants_loop:
                self._wants_loop = False
                self._close_loop()
            else:
                self._work()
        self.correction = compose(self.pose, inverse(odometry))

    @property
    def session(self) -> Session:
        """All that is known, to go on with another day."""
        places = self._places
        resolution, share = self._parameters.resolution, self._noise.share
        held = places.held
        scans = [scan for number in held if (scan := places.scan(number)) is not None]
        return Session(places.poses[held], scans, places.edges(), resolution, share)

    def take_session(self, session: Session) -> None:
        """Replace the present knowledge by that of a session."""
        places, edges = Places(), session.edges
        self._noise.take(session.share)
        self._drawing.clear()
        self._places = places
        for pose, scan in zip(session.poses, session.scans, strict=True):
            places.add(scan, find_surface(scan, self._noise.noise), pose)
            self._drawing.add_last(places, self._noise.noise)
        for pair, pose, known, robust in zip(*edges, strict=True):
            places.link((int(pair[0]), int(pair[1])), pose, known, sure=not robust)

    def begin_at(
        self,
        pose: np.ndarray,
        spread: np.ndarray,
        odometry: np.ndarray,
        covariance: np.ndarray,
    ) -> None:
        """Go on from a pose in the map, of a covariance `spread`, at some odometry."""
        self._tracker.move(odometry, covariance)
        self._tracker.put(pose, spread)
        near = self._nearest(pose)
        away = np.hypot(*(self._places.poses[near, :2] - pose[:2]).T)
        self._reference, self._recent = int(near[away.argmin()]), near.tolist()
        self._since = self._since + CARRIED  # the way here is unknown, the pose is not
        self._scans = 0
        self._mark = np.zeros(3)
        self._show()
        self.correction = compose(self.pose, inverse(odometry))

    def take_leap(self, before: np.ndarray, after: np.ndarray) -> None:
        """Stay in place while the pose in the odom frame is another from now on, shapes (3,)."""
        self._tracker.leap()
        self._since = self._since + LEAP
        self.correction = compose(compose(self.correction, before), inverse(after))

    def _follow(self, scan: Scan, surface: Surface, move: np.ndarray) -> None:
        """Be where odometry says, then where the scan fits best, as far as odometry lets it."""
        tracker = self._tracker
        before = compose(tracker.pose, inverse(move))
        self._since = add_covariance(self._since, before, move, tracker.move_growth)
        fit = tracker.fit(self._local, surface.points)
        # Hits that `Comers` left out, such as people, fit nothing.
        share = fit.share * self._left_in
        is_fit = share >= LEAST_SHARE or self._fits_what_is_known(surface, fit)
        self._misfits = 0 if is_fit or len(surface.points) < FEWEST else self._misfits + 1
        if is_fit:
            self._search = None
            tracker.believe(fit)
            if tracker.has_slipped:
                self._since = self._since + tracker.covariance
        else:
            tracker.told = np.zeros((3, 3))
            self._share = share
            if self._misfits > 1:
                self._seek(scan, surface, move)

    def _fits_what_is_known(self, surface: Surface, fit: Fit) -> bool:
        """Whether a scan fits the known part of the map; its other points do not count."""
        points = surface.points
        least = self._parameters.range_noise
        counts = count_fitting(self._local, points, fit.pose, least, *self._drawing.odds)
        fits, new, behind = counts
        in_free_space = len(points) - self._left_in * sum(counts)  # of what is left in
        # Through a door that was opened much is new, but little is where all was free.
        if 2.0 * in_free_space < self._left_in * behind:
            new += behind
        return fits >= FEWEST_OF_NEW and fits >= LEAST_SHARE * (len(points) - new)

    def _seek(self, scan: Scan, surface: Surface, move: np.ndarray) -> None:
        """Search around for where the robot has slipped to, or everywhere, if it is not there."""
        if self._search is None:
            pyramid = Pyramid(self.grid)
            window = window_around(self.pose, np.full(2, SLIP), SLIP_TURN)
            self._search = Search(
                pyramid, scan.points, window if self.is_found else pyramid.everywhere
            )
        else:
            self._search.moved = compose(self._search.moved, move)
        if not self._search.work() or self._search.found is None:
            return
        (poses, _), moved, self._search = self._search.found, self._search.moved, None
        for pose in poses[:1]:
            at = compose(pose, moved)
            noise = self._parameters.range_noise
            near = self._nearest(at)
            self._places.show(self._old, at[:2], near)
            fit = Fit(*fit_scan(self._old, surface.points, at, LOOP_PRIOR, noise, ROUNDS))
            if fit.share >= LEAST_SHARE:
                self._recent = near.tolist()
                self._misfits = 0
                self._tracker.told = TRUST * fit.information
                self._tracker.put(fit.pose, invert(LOOP_PRIOR + self._tracker.told))
                # How it came here from the last place nobody knows; the map does.
                self._since = self._since + CARRIED
                self._show()

    def _nearest(self, pose: np.ndarray) -> np.ndarray:
        """Return the numbers of the places nearest to a pose, in their order."""
        held = self._places.held
        away = np.hypot(*(self._places.poses[held, :2] - pose[:2]).T)
        near = held[np.argsort(away, kind='stable')[: self._parameters.scan_buffer_size]]
        return np.sort(near)

    def _is_back(self, surface: Surface) -> bool:
        """
        See whether the robot is at a known place, in a map that fits: that is its place now.

        So cost and memory grow with the area, not with the way.
        """
        self._take_solved()
        places, pose = self._places, self.pose
        count = len(places) - self._parameters.scan_buffer_size
        if count < 1:
            return False
        away = np.hypot(*(places.poses[:count, :2] - pose[:2]).T)
        turned = np.abs((places.poses[:count, 2] - pose[2] + np.pi) % (2.0 * np.pi) - np.pi)
        is_known = np.count_nonzero(away < KNOWN_REACH) >= MANY
        reach = SAME_SHARE * self._parameters.minimum_travel_distance
        is_same = np.count_nonzero((away < reach) & (turned < SAME_TURN)) >= ENOUGH
        if not (is_same or is_known):
            return False
        held = places.held
        held = held[held < count]
        nearest = int(held[np.argmin(away[held])])
        near = self._nearest(pose)
        places.show(self._old, pose[:2], near)
        noise = self._parameters.range_noise
        fit = Fit(*fit_scan(self._old, surface.points, pose, SAME_PRIOR, noise, ROUNDS))
        off = np.abs(compose(inverse(pose), fit.pose))
        if fit.share < (SAME_FIT if is_same else KNOWN_FIT) or (off > SAME_ERROR).any():
            return False
        told = TRUST * fit.information
        here = compose(inverse(places.poses[nearest]), fit.pose)
        if nearest != self._reference:
            self._link_back(nearest, here, told, off)
        self._reference, self._recent, self._mark = nearest, near.tolist(), here
        self._tracker.told, self._tracker.pose = told, fit.pose
        # What is not known of the way to where the scan tells little, as along a corridor, stays.
        self._since = invert(told + invert(self._since + invert(SAME_PRIOR)))
        self._wants_loop = False
        self._scans = LOOK_AGAIN
        self._local, self._old = self._old, self._local
        if places.visits[nearest] < MOST_VISITS:
            places.join(nearest, surface.points, here, self._old)
        return True

    def _link_back(
        self, nearest: int, here: np.ndarray, told: np.ndarray, off: np.ndarray
    ) -> None:
        """Add how a place, in whose frame the robot is `here`, lies from the last."""
        places = self._places
        last = places.poses[self._reference]
        way = compose(compose(inverse(last), self.pose), inverse(here))
        known = turn_axes(invert(self._since + invert(told + SLIGHT)), -last[2])
        places.link((self._reference, nearest), way, known, sure=False)
        self._solve_soon(off)

    def _look_again(self, scan: Scan, surface: Surface) -> None:
        """Draw what is seen now where the robot has been before: things come and go."""
        self._scans = 0
        pose = compose(inverse(self._places.poses[self._reference]), self.pose)
        self._places.draw(self._reference, scan.seen_from(pose))
        self._drawing.add(scan, surface, self.pose)

    def _is_elsewhere(self) -> bool:
        if self._misfits:
            return False
        last = compose(self._places.poses[self._reference], self._mark)
        away = math.hypot(self.pose[0] - last[0], self.pose[1] - last[1])
        return (
            away > self._parameters.minimum_travel_distance
            or abs(wrap(self.pose[2] - last[2])) > self._parameters.minimum_travel_heading
        )

    def _keep(self, scan: Scan, surface: Surface) -> None:
        """Add the place where the robot is."""
        places = self._places
        self._take_solved()
        places.add(scan, surface, self.pose)
        number, last = len(places) - 1, self._reference
        if number:
            known = self._tracker.told + invert(self._since)
            before = places.poses[last]
            pose = compose(inverse(before), self.pose)
            places.link((last, number), pose, turn_axes(known, -before[2]), sure=True)
        self._reference, self._scans, self._mark = number, 0, np.zeros(3)
        self._since = np.zeros((3, 3))
        self._recent.append(number)
        self._show()
        self._drawing.add_last(places, self._noise.noise)
        self._wants_loop = number % self._parameters.loop_every == 0

    def _merge(self) -> None:
        """Merge those two places near by that are nearest to each other, if there are too many."""
        places, held = self._places, self._places.held
        if len(held) <= max(MOST_OF_FEW, MOST_PLACES * self._drawing.area):
            return
        away = np.hypot(*(places.poses[held, :2] - self.pose[:2]).T)
        near = held[(away < MERGE_REACH) & ~np.isin(held, self._recent)]
        if len(near) < 2:
            return
        apart = places.poses[near, None] - places.poses[None, near]
        turns = (apart[:, :, 2] + math.pi) % (2.0 * math.pi) - math.pi
        apart[:, :, 2] = SAME_ARM * turns
        squares = (apart * apart).sum(axis=2)
        squares[np.tril_indices(len(near))] = np.inf
        older, newer = np.unravel_index(int(squares.argmin()), squares.shape)
        places.merge(int(near[newer]), int(near[older]))

    def _show(self) -> None:
        """Draw places into the local map: the last, or those around where it was found again."""
        self._recent = self._recent[-self._parameters.scan_buffer_size :]
        self._places.show(self._local, self.pose[:2], np.array(self._recent))

    def _close_loop(self) -> None:
        """See whether the last place lies where the robot was long ago, and link the two."""
        places, number = self._places, len(self._places) - 1
        pose = places.poses[number]
        held = places.held
        held = held[held < number + 1 - self._parameters.scan_buffer_size]
        if not len(held):
            return
        away = np.hypot(*(places.poses[held, :2] - pose[:2]).T)
        if away.min() > self._parameters.loop_search_maximum_distance:
            return
        nearest = int(held[away.argmin()])
        size = self._parameters.loop_match_minimum_chain_size
        around = np.sort(held[np.argsort(away, kind='stable')[:size]])
        places.show(self._old, pose[:2], around)
        fit = Fit(
            *fit_scan(
                self._old,
                places.points(number),
                pose,
                LOOP_PRIOR,
                self._parameters.range_noise,
                2 * ROUNDS,
            )
        )
        if fit.share < LEAST_LOOP_SHARE:
            return
        old = places.poses[nearest]
        known = turn_axes(TRUST * fit.information, -old[2])
        places.link((nearest, number), compose(inverse(old), fit.pose), known, sure=False)
        self._solve_soon(np.abs(compose(inverse(pose), fit.pose)))

    def _solve_soon(self, off: np.ndarray) -> None:
        """Count a closed loop, and solve for the places where it is far off or one of many."""
        self.closures += 1
        self._unsolved += 1
        if (off > LOOP_ERROR).any() or self._unsolved >= MOST_UNSOLVED:
            self._unsolved = 0
            self._solver.ask()

    def _work(self) -> None:
        """Go on with what takes longer than a step may."""
        places = self._places
        self._merge()
        if self._solver.is_idle:
            self._solving = places.held
        if not self._solver.work(places.poses[self._solving], places.edges):
            self._drawing.work(places, self._noise.noise)

    def _take_solved(self) -> None:
        """Move places, and the robot with the last of them, to where the solver has them."""
        poses, places = self._solver.take(), self._places
        if poses is None:
            return
        numbers = self._solving
        at = min(int(np.searchsorted(numbers, self._reference)), len(numbers) - 1)
        change = compose(poses[at], inverse(places.poses[numbers[at]]))
        for number in range(numbers[-1] + 1, len(places)):
            places.poses[number] = compose(change, places.poses[number])
        places.poses[numbers] = poses
        places.follow()
        self._tracker.shift(change)
        self._since = turn_axes(self._since, float(change[2]))
        self._drawing.see_moves(places)
