# SPDX-License-Identifier: Apache-2.0
"""Localisation, path following and the state of a goal."""

from collections.abc import Callable
import math
from typing import NamedTuple

import numpy as np
from wasd_core.timing import Watchdog

from wasd_navigation.exploring import Explorer
from wasd_navigation.keepout import Keepout
from wasd_navigation.mapping.localizer import Localizer
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.odometry import leaps, Odometry
from wasd_navigation.planning.driver import Driver
from wasd_navigation.records import Grid, Scan, UNKNOWN
from wasd_navigation.se2 import compose, inverse, transform
from wasd_navigation.slopes import Slopes
from wasd_navigation.traversability import Traversability

# While it searches for a way to unknown space, it checks the map at this period [s].
LOOK_AROUND = 0.5
# Odometry, or a lidar, that is silent for so long is gone [s].
SILENCE = 0.5
# A goal waits so long for what it needs [s]: a forgotten goal must not move the robot.
PATIENCE = 10.0
# The driver plans on a map that is at most so old [s]: drawing one takes as long as 20 steps.
LOOK_PERIOD = 1.0
# The robot counts as stuck only this long after a goal came [s]: before that it may have got stuck
# on the way to the last goal.
STUCK_AFTER = 2.5
NOWHERE = np.full(3, math.nan)
# A robot that maps takes goals up to so far beyond its map [m], and plans with so much around one.
BEYOND, AROUND_GOAL = 50.0, 2.0
# Steps no farther than this count at once, like hits of the lidar [m].
STEPS_NEAR = 1.5
# No map has these revisions.
NOTHING_DRAWN = (-1, -1)
# Why a goal is cancelled when another comes.
REPLACED = 'another goal replaced it'
# States of a driver in which it has done with a goal.
ENDS = ('arrived', 'refused', 'failed')


Locator = Mapper | Localizer


class Outcome(NamedTuple):
    """The end of a goal: arrived, refused, failed or cancelled, with the reason."""

    state: str
    reason: str = ''


class Navigator:
    """
    Feeds a locator with scans and a pilot with the map, and keeps one goal.

    `move` comes with each odometry, `see` with each scan and the odometry of its instant, `step`
    at a steady rate. It reads no clock. `on_end` are told how each goal has ended. It drives only
    while odometry, and a lidar not silent for more than `silence` [s], are heard; a goal that has
    to wait for long ends. `ground` is what a robot with legs knows of the ground, if
    anything.
    """

    def __init__(
        self,
        locator: Locator,
        pilot: Driver,
        silence: float = SILENCE,
        explorer: Explorer | None = None,
        keepout: Keepout | None = None,
    ) -> None:
        self.locator = locator
        self.keepout = keepout
        self._was_inside = False  # of a keepout area
        self.ground: Traversability | None = None
        self._use(pilot)
        self._explorer = explorer
        self._is_searching = False  # for a way to unknown space
        self._searched = 0.0  # since it has looked what it has seen [s]
        self.goal: np.ndarray | None = None
        self.last_goal = NOWHERE  # that one, or the one before
        self.outcome: Outcome | None = None  # of the last goal, until the next
        self.on_end: list[Callable[[Outcome], None]] = []
        self.elapsed = 0.0  # since the goal came [s]
        self.scans = 0
        self._odometry: Odometry | None = None
        self._fresh, self._sighted = Watchdog(SILENCE), Watchdog(silence)
        self._waited = 0.0  # without a break, with a goal [s]
        self._was_placed = False  # since the goal came
        self._awaits_yaw = False  # until it is known where the robot is
        self._seen: tuple[Scan, np.ndarray] | None = None
        self._slopes = Slopes()
        self._grid: Grid | None = None
        # Of the map that is planned on; of the locator's and of the ground in it.
        self._revision, self._drawn = 0, NOTHING_DRAWN
        self._looked = 0.0

    @property
    def pose(self) -> np.ndarray | None:
        """T_map_base of now, shape (3,); None before there is odometry."""
        if self._odometry is None:
            return None
        return np.asarray(compose(self.locator.correction, self._odometry.pose))

    @property
    def state(self) -> str:
        """One word: idle, waiting, driving, turning, recovering, arrived, refused, ..."""
        if self.goal is None:
            return 'idle' if self.outcome is None else self.outcome.state
        return 'waiting' if self.missing else self.pilot.state

    @property
    def reason(self) -> str:
        """Why it is in this state, '' where the state says it all."""
        if self.goal is None:
            return '' if self.outcome is None else self.outcome.reason
        if self._is_searching and not self.pilot.reason:
            return f'searches for a way to ({self.goal[0]:.2f}, {self.goal[1]:.2f})'
        return self.missing or self.pilot.reason

    @property
    def grid(self) -> Grid:
        """The map that is planned on, which is at most LOOK_PERIOD old while it drives."""
        return self._look()

    @property
    def seen(self) -> Grid:
        """The map with what is known of the ground."""
        grid = self.locator.grid
        return grid if self.ground is None else self.ground.over(grid)

    @property
    def notice(self) -> str:
        """What a localiser has to say, '' where all is well."""
        return getattr(self.locator, 'notice', None) or ''

    @property
    def is_placed(self) -> bool:
        """Whether it is known where in the map the robot is."""
        return self.scans > 0 and bool(getattr(self.locator, 'is_found', True))

    @property
    def is_mapping(self) -> bool:
        """Whether its map grows, so that goals may be in unknown space."""
        return bool(getattr(self.locator, 'grows', False))

    @property
    def missing(self) -> str:
        """What has to come before anything can drive."""
        if not self.scans:
            return 'no scan has come yet'
        if not self.is_placed:
            return self.notice or 'the robot does not know yet where it is'
        if not self._fresh.is_alive:
            return 'odometry is silent'
        return '' if self._sighted.is_alive else 'the lidar is silent or blind'

    def move(self, odometry: Odometry) -> bool:
        """
        Take the newest odometry; one that is not finite is none.

        Return whether it has leapt, as when it is set to 0: then the goal is to end.
        """
        if not (np.isfinite(odometry.pose).all() and np.isfinite(odometry.velocity).all()):
            return False
        before, self._odometry = self._odometry, odometry
        has_leapt = before is not None and leaps(before.pose, odometry.pose, self._fresh.age)
        if before is not None and has_leapt:
            self.locator.take_leap(before.pose, odometry.pose)
            self._seen = None
            self._slopes.reset()
            self.pilot.pause()
        self._fresh.hear()
        return has_leapt

    def see(self, scan: Scan, odometry: Odometry, age: float = 0.0) -> None:
        """Take a scan and the odometry of its instant, which is `age` [s] ago."""
        if not (np.isfinite(odometry.pose).all() and np.isfinite(odometry.covariance).all()):
            return  # locators take no such thing in
        firm = self._slopes.leave_out(scan, odometry.pose)
        self.locator.step(firm, odometry.pose, odometry.covariance)
        self.scans += 1
        self._seen = scan, odometry.pose
        self._sighted.hear(age)

    def configure(self, pilot: Driver, silence: float) -> None:
        """Take another pilot, and how long the lidar may be silent [s]; ends no goal."""
        self._use(pilot)
        self._sighted.timeout = silence

    def _use(self, pilot: Driver) -> None:
        self.pilot = pilot
        pilot.shape = self._straighten

    def set_goal(self, goal: np.ndarray) -> None:
        """
        Drive to T_map_goal, shape (3,), instead of where it was going.

        A yaw of NaN is that of the line from the robot to the goal.
        """
        if self.goal is not None:
            self._end(Outcome('cancelled', REPLACED))
        self._awaits_yaw = math.isnan(goal[2]) and not self.is_placed
        goal = self._with_yaw(goal)
        self.goal = self.last_goal = goal
        self.outcome, self.elapsed = None, 0.0
        self._waited, self._was_placed = 0.0, False
        self._looked, self._drawn = math.inf, NOTHING_DRAWN
        self._is_searching = False
        self.pilot.set_goal(goal, self.is_mapping)

    def refuse(self, why: str, goal: np.ndarray = NOWHERE) -> None:
        """End what it was doing, and take no other goal, because of something."""
        self.cancel(REPLACED)
        self.last_goal, self.elapsed, self.pilot.recoveries = self._with_yaw(goal), 0.0, 0
        self._end(Outcome('refused', why))

    def cancel(self, why: str) -> bool:
        """Drive no more, because of something; return whether it was driving."""
        if self.goal is None:
            return False
        self.pilot.cancel()
        self._end(Outcome('cancelled', why))
        return True

    def reset(self) -> None:
        """Begin again."""
        self.cancel('the map begins again')
        self.locator.reset()
        self.pilot.reset()
        self.outcome, self.scans = None, 0
        self._odometry = self._seen = self._grid = None
        self._slopes.reset()
        self._fresh.reset()
        self._sighted.reset()

    def step(self, dt: float) -> np.ndarray | None:
        """Let `dt` [s] pass; return the velocity to command, shape (3,), None where none is."""
        self._fresh.step(dt)
        self._sighted.step(dt)
        self._looked += dt
        self.elapsed += dt
        if self.goal is None:
            return None
        pose = self.pose
        if (missing := self.missing) or pose is None or self._odometry is None:
            self._wait(missing, dt)
            return np.zeros(3)
        self._waited, self._was_placed = 0.0, True
        if self._awaits_yaw:
            self._awaits_yaw = False
            self.goal = self.last_goal = self._with_yaw(np.array((*self.goal[:2], math.nan)))
            self.pilot.set_goal(self.goal, self.is_mapping)
        if self.elapsed > STUCK_AFTER and getattr(self.locator, 'is_stuck', False):
            self.pilot.cancel()
            self._end(Outcome('failed', self.notice))
            return np.zeros(3)
        grid = self._look()
        velocity = self.pilot.step(
            grid, self._revision, pose, self._odometry.velocity, self._take_scan(), dt
        )
        if self.is_mapping and self._searches(grid, pose, dt):
            return velocity if self.pilot.state not in ENDS else np.zeros(3)
        if self.pilot.state in ENDS:
            self._end(Outcome(self.pilot.state, self.pilot.reason))
            return np.zeros(3)
        return velocity if np.isfinite(velocity).all() else np.zeros(3)

    def _searches(self, grid: Grid, pose: np.ndarray, dt: float) -> bool:
        """
        Whether it continues to search for a way to unknown space.

        It does when the straightest way there, through the unknown, was none: it drives to one
        frontier after the other from which another may lead there, until the goal is seen.
        """
        explorer, has_ended = self._explorer, self.pilot.state in ENDS
        if self.goal is None or explorer is None or not (self._is_searching or has_ended):
            return False
        self._searched += dt
        if not has_ended and self._searched < LOOK_AROUND:
            return True
        self._searched = 0.0
        if not self._is_unknown(grid, self.goal):
            if self._is_searching:
                self.pilot.set_goal(self.goal, True)
            was_searching, self._is_searching = self._is_searching, False
            return was_searching
        if not self._is_searching:
            explorer.forget()
        elif not explorer.is_seen(grid, pose):
            if not has_ended:
                return True
            explorer.give_up()
        return self._look_from(explorer.choose(grid, pose, self.goal[:2]))

    def _look_from(self, stage: np.ndarray | None) -> bool:
        """Drive to a frontier on the way to the goal; return whether there is one, or was."""
        assert self.goal is not None
        if stage is not None:
            self._is_searching = True
            self.pilot.set_goal(self._with_yaw(stage))
        elif self._is_searching:
            self._is_searching = False
            self.pilot.cancel()
            x, y, _ = self.goal
            why = f'no way leads to ({x:.2f}, {y:.2f}): no frontier is left'
            self._end(Outcome('failed', why))
            return True
        return stage is not None

    def _is_unknown(self, grid: Grid, goal: np.ndarray) -> bool:
        """Whether a goal is in unknown space of the map."""
        if not np.isfinite(goal).all():
            return False
        cell = grid.to_cells(goal[None, :2])
        return bool(grid.covers(cell)[0] and grid.cells[tuple(cell[0])] == UNKNOWN)

    def _wait(self, missing: str, dt: float) -> None:
        """Stand because something is missing, but not for ever; not at all when it got lost."""
        self._seen = None
        self._waited += max(dt, 0.0)
        self.pilot.pause()
        is_lost = self._was_placed and not self.is_placed
        if is_lost or self._waited > PATIENCE:
            self.pilot.cancel()
            self._end(Outcome('failed', missing))

    def _look(self) -> Grid:
        """Return the map to plan on; to look at it does not change when it is drawn again."""
        if self._grid is None or self._looked >= LOOK_PERIOD:
            self._looked = 0.0
            is_inside = self.is_kept_out
            ground = 0 if self.ground is None else self.ground.revision
            newest = self.locator.revision, ground
            is_old = self._drawn != newest
            if self._grid is None or is_old or is_inside or self._was_inside:
                self._was_inside = is_inside
                self._grid, self._drawn = self._map(), newest
                self._revision += 1
        return self._grid

    @property
    def is_kept_out(self) -> bool:
        """Whether the robot is where it is not to be."""
        pose = self.pose
        return self.keepout is not None and pose is not None and self.keepout.overlaps(pose)

    def _map(self) -> Grid:
        """Return the map, with a goal beyond it where it grows, and keepout areas."""
        grid = self._known()
        return grid if self.keepout is None else self.keepout.applied(grid, self.pose)

    def _known(self) -> Grid:
        """Return the map, with a goal beyond it where it grows."""
        grid, goal = self.seen, self.goal
        if goal is None or not self.is_mapping or not np.isfinite(goal).all():
            return grid
        high = grid.to_points(np.array(grid.cells.shape)[None])[0]
        off = np.abs(goal[:2] - np.clip(goal[:2], grid.origin, high)).max()
        return grid.grown_to(goal[:2], AROUND_GOAL) if off <= BEYOND else grid

    def _straighten(self, velocity: np.ndarray) -> np.ndarray:
        """Return a velocity that climbs straight, where the ground is steep."""
        if self.ground is None or self._odometry is None:
            return velocity
        way = transform(inverse(self.locator.correction), self.pilot.path.copy())
        return self.ground.straighten(velocity, self._odometry.pose, way)

    def _take_scan(self) -> Scan | None:
        """Return a scan that has come since the last call, in the base frame of now."""
        if self._seen is None or self._odometry is None:
            return None
        (scan, at), self._seen = self._seen, None
        base = inverse(self._odometry.pose)
        scan = scan.seen_from(compose(base, at))
        if self.ground is None:
            return scan
        steps = self.ground.steps_near(self._odometry.pose, STEPS_NEAR)
        return scan.with_hits(transform(base, steps))

    def _with_yaw(self, goal: np.ndarray) -> np.ndarray:
        """Return a goal with the yaw of the line to it where it has none."""
        if not math.isnan(goal[2]):
            return goal
        x, y, _ = (0.0, 0.0, 0.0) if self.pose is None else self.pose
        return np.array([*goal[:2], math.atan2(goal[1] - y, goal[0] - x)])

    def _end(self, outcome: Outcome) -> None:
        self.goal, self.outcome = None, outcome
        for tell in self.on_end:
            tell(outcome)
