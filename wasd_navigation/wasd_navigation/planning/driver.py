# SPDX-License-Identifier: Apache-2.0
"""Drives a robot to a goal: the state machine around route, sampler and docking."""

from collections.abc import Callable
import math
from typing import NamedTuple

import numpy as np

from wasd_navigation.parameters import DriveLimits, Footprint, PlanningParameters
from wasd_navigation.planning.docking import Docking
from wasd_navigation.planning.motion import base_of, clearance, IN_GAP, PoseFilter
from wasd_navigation.planning.route import AT_ONCE, Route, SLICE
from wasd_navigation.planning.sampling import is_safe, Sampler, Scene
from wasd_navigation.planning.surroundings import Surroundings
from wasd_navigation.records import FEWEST, Grid, Scan, UNKNOWN
from wasd_navigation.se2 import wrap

# From so much left on it is looked whether the goal is there straight away [m].
_DOCKING = 1.5
# Coming nearer by less than this is no progress [m]; by more than this, which is more than it
# backs up, what it has recovered from is behind it.
_NEARER, _PAST = 0.1, 0.5
# No way at all: so long it is waited for one, before that counts as one recovery [s].
_WAIT = 2.0
# A command holds so long, with all that delays it, before the next one can stop the robot [s].
_HOLD = 0.15
# Recoveries in all are no more than so many times those in a row.
_IN_ALL = 3
_SHARES = (1.0, 0.5, 0.25)
# Of the margin, what all motions keep; and where there is hardly more [m].
_KEPT, _NOISE = 0.5, 0.005
# So long it waits for people to leave the way to a goal before that is refused; so long after
# one look at the way comes the next [s].
_FOR_PEOPLE, _AGAIN = 15.0, 0.5
# Where people are about it may recover so many times as often: they go away.
_WITH_PEOPLE = 2
# How the reason ends for which it stands.
_WAITING = ': waiting'
# A goal in unseen space fails after it has been seen to be none for so long [s]; where people may
# stand in it, only after the time for people.
_SEEN_FOR = 3.0
# So much more of the map that is known is as good as coming nearer to a goal that is not [m^2].
_NEWS = 0.3
# Recoveries in a row on the way to unknown space.
_UNSEEN = 2
# So long it goes on to the goal before while the way to the next one is drawn [s].
_BRIDGE = 1.0


class Manoeuvre(NamedTuple):
    """A velocity (vx, vy, wz) for a time [s], and its name."""

    velocity: np.ndarray
    duration: float
    what: str


def choose_manoeuvre(count: int, limits: DriveLimits) -> Manoeuvre:
    """Return the manoeuvre number `count`, from 0: back up and turn take turns, left and right."""
    if count % 2 == 0:
        speed = min(limits.backward, 0.15)
        return Manoeuvre(np.array((-speed, 0.0, 0.0)), 0.3 / speed, 'backing up')
    rate = 0.6 * limits.yaw * (1.0 if count % 4 == 1 else -1.0)
    return Manoeuvre(np.array((0.0, 0.0, rate)), 0.5 * math.pi / abs(rate), 'turning')


class Driver:
    """
    Takes the map, the pose, the velocity and scans; returns the velocity to command.

    All poses are (x, y, yaw) [m, rad] in the map frame, velocities (vx, vy, wz) [m/s, rad/s] in
    the base frame, shape (3,). `state` is `idle`, `driving`, `turning` (at the goal, to its
    heading), `recovering`, `arrived`, `refused` or `failed`; `reason` says in a sentence why it
    is in that state, where there is something to say. `way` is of the plan, `recoveries` how
    often it had to recover since the goal was set. `shape` turns a velocity that it has chosen on
    its way into the one that it asks for.
    """

    def __init__(
        self,
        limits: DriveLimits,
        footprint: Footprint,
        parameters: PlanningParameters | None = None,
    ) -> None:
        self._limits, self._footprint = limits, footprint
        self._parameters = parameters or PlanningParameters()
        self.shape: Callable[[np.ndarray], np.ndarray] = lambda velocity: velocity
        self._base = base_of(limits)
        self._sampler = Sampler(self._base, self._parameters.samples, self._parameters.horizon)
        self.reset()

    def reset(self) -> None:
        """Know of nothing: no goal, no map, no obstacle."""
        self._around = Surroundings(self._footprint, self._parameters)
        self._filter = PoseFilter()
        self.recoveries, self._bridged = 0, 0.0
        self.cancel()

    def cancel(self, reason: str = '') -> None:
        """Forget the goal, and stand."""
        self.state, self.reason = 'idle', reason
        self._route: Route | None = None
        self._before: Route | None = None
        self.local_path = np.empty((0, 2))

    def set_goal(self, goal: np.ndarray, may_be_unknown: bool = False) -> None:
        """
        Drive to a goal from the next step on, in place of any other.

        With `may_be_unknown` it may be in unknown space: the robot drives there.

        One that drives goes on to the goal before while the way to this one is drawn, for a
        second at most: goals that come one after another do not make it stand.
        """
        before = self._route if self.state == 'driving' and self._docking is None else None
        if not self.is_under_way:
            self.pause()
            self._around.movers.forget()
        if before is not None and before.values is None:
            before = self._before  # that one had no time to be drawn
        else:
            self._bridged = 0.0
        self.cancel()
        self._before = before
        self.recoveries = 0
        self._route = self._route_to(np.array(goal, float), may_be_unknown)
        self.state = 'driving'
        self._is_new, self._is_checked = True, False
        self._refused_for, self._held_back = 0.0, 0.0
        self._seen_for, self._known = 0.0, 0.0
        if before is None:
            self._sampler.reset()
        self._docking: Docking | None = None
        self._start_over()
        self._manoeuvre: Manoeuvre | None = None
        self._manoeuvred = 0.0

    def _route_to(self, goal: np.ndarray, may_be_unknown: bool) -> Route:
        return Route(goal, self._footprint, self._base, self._parameters, may_be_unknown)

    @property
    def _pose(self) -> np.ndarray | None:
        return self._filter.pose

    @property
    def goal(self) -> np.ndarray | None:
        """Where it drives to, shape (3,)."""
        return None if self._route is None else self._route.goal

    @property
    def path(self) -> np.ndarray:
        """The way from the robot to the goal, shape (n, 2) [m]."""
        return np.empty((0, 2)) if self._route is None else self._route.way[:, :2]

    @property
    def costmap(self) -> Grid | None:
        """What is around, as costmaps have it; None before there was a map."""
        return self._around.costmap if self._around.grid.cells.size else None

    @property
    def distance_left(self) -> float:
        """Length of the way to the goal [m]."""
        steps = np.diff(self.path, axis=0)
        return float(np.hypot(steps[:, 0], steps[:, 1]).sum())

    @property
    def time_left(self) -> float:
        """How long the way will take, about [s]."""
        if self._route is None or self._pose is None:
            return 0.0
        turn = abs(wrap(float(self._route.goal[2] - self._pose[2])))
        return 1.2 * self.distance_left / self._limits.forward + turn / self._limits.yaw

    @property
    def is_under_way(self) -> bool:
        """Whether it drives, or tries to."""
        return self.state in ('driving', 'turning', 'recovering')

    def step(
        self,
        grid: Grid,
        revision: int,
        pose: np.ndarray,
        velocity: np.ndarray,
        scan: Scan | None,
        dt: float,
    ) -> np.ndarray:
        """
        Return the velocity to ask for, a time `dt` [s] after the last step.

        `grid` is another one than in the step before only when `revision` is. `scan` is one that
        came since then, taken at about `pose`; None when none came.
        """
        known = bool(np.isfinite(pose).all() and np.isfinite(velocity).all())
        if known:
            self._filter.step(pose, velocity, dt)
            self._around.movers.step(dt)
            self._around.take_map(grid, revision, pose[:2])
            if scan is not None:
                self._around.see(scan, pose)
        if not self.is_under_way:
            return self._stand()
        if not known:
            return self._stand('the pose or the velocity is not a number: the robot stands')
        assert self._pose is not None
        state = np.concatenate((self._pose, velocity))
        asked = self._choose(state, dt)
        return self._held(self.shape(asked) if self.state == 'driving' else asked, state)

    def pause(self) -> None:
        """Forget how it moves, before a time without steps; the goal stays."""
        self._filter = PoseFilter()
        self._sampler.reset()

    def _stand(self, reason: str | None = None) -> np.ndarray:
        if reason is not None:
            self.reason = reason
            self.pause()
        return np.zeros(3)

    def _held(self, asked: np.ndarray, state: np.ndarray) -> np.ndarray:
        """Return the largest share of a velocity after which the robot can still stop."""
        if not np.isfinite(asked).all():
            return np.zeros(3)
        if not asked.any():
            return asked
        route = self._before or self._route
        assert route is not None
        scene = self._scene(route)
        for share in _SHARES:
            if is_safe(state, share * asked, scene, self._base, _HOLD, share == _SHARES[-1]):
                return share * asked
        turn = asked * (0.0, 0.0, 1.0)
        return turn if is_safe(state, turn, scene, self._base, _HOLD, True) else np.zeros(3)

    def _scene(self, route: Route) -> Scene:
        assert route.values is not None
        assert self._pose is not None
        margin, circles = self._parameters.margin, self._footprint.circles
        room = clearance(self._around.distances, circles, self._pose, margin)
        # In a gap, noise may show less room than there was when it drove in.
        share = _KEPT if room > _KEPT * margin + _NOISE else IN_GAP
        keep = (share * margin, self._parameters.comfort)
        return Scene(
            self._around.distances,
            route.values,
            self._footprint.circles,
            route.way,
            keep,
            self._around.movers.now,
        )

    def _choose(self, state: np.ndarray, dt: float) -> np.ndarray:
        """Return the velocity that leads on, by the state of things."""
        route = self._route
        assert route is not None
        was_new = self._is_new
        if was_new and not self._begin(state[:3], dt):
            return self._bridge(state, dt)
        self._before = None
        # What has been drawn in a first step is enough for it.
        left = route.keep_up(self._around, state[:3], 0.0 if was_new else dt)
        if self._docking is not None and (self._docking.goal != route.goal).any():
            self._docking = None
        if route.may_be_unknown and not self._may_still_be(route, dt):
            return np.zeros(3)
        if self._manoeuvre is not None:
            return self._recover(dt)
        if left == math.inf:
            return self._wait(dt)
        self._watch(left, dt)
        if self._manoeuvre is not None or not self.is_under_way:
            return np.zeros(3)
        if self._docking is None and left < _DOCKING:
            self._docking = self._may_dock(state)
        if self._docking is not None:
            return self._dock(self._docking, state, dt)
        self.state, self.reason = 'driving', self._to_look(route)
        return self._sample(route, state, dt)

    def _to_look(self, route: Route) -> str:
        """Return the remark on a goal in unseen space; '' for others."""
        (x, y), grid = route.asked[:2], self._around.whole
        if route.is_to_look:
            return f'({x:.2f}, {y:.2f}) is in an obstacle: the robot drives there to look'
        cell = grid.to_cells(route.goal[None, :2])
        if grid.covers(cell)[0] and grid.cells[tuple(cell[0])] != UNKNOWN:
            return ''
        x, y = route.goal[:2]
        return f'({x:.2f}, {y:.2f}) is unknown: the robot drives there to look'

    def _sample(self, route: Route, state: np.ndarray, dt: float) -> np.ndarray:
        """Return the velocity that leads along a route."""
        velocity = self._sampler.step(state, self._scene(route), dt)
        self.local_path = self._sampler.foresee(state)
        return velocity

    def _bridge(self, state: np.ndarray, dt: float) -> np.ndarray:
        """Go on to the goal before while there is no way yet to the new one."""
        self._bridged += dt
        if not self.is_under_way or self._bridged > _BRIDGE:
            self._before = None
        if self._before is None:
            return np.zeros(3)
        self._before.lead_from(state[:3])
        return self._sample(self._before, state, dt)

    def _begin(self, pose: np.ndarray, dt: float) -> bool:
        """Return whether there is a way to a new goal, as soon as that is known."""
        route = self._route
        assert route is not None
        if self._held_back > 0.0:
            self._held_back -= dt
            self._refused_for += dt
            return False
        # Each step does one part of the work: a key pressed meanwhile must not wait for all of it.
        if not self._is_checked:
            self._is_checked = True
            reason = route.refusal(self._around)
            if reason is not None and self._may_aim(route.asked):
                route.aim(self._around, pose)
                reason = reason if route.off == 0.0 else None
            if reason is None and route.is_shut_off(self._around, pose):
                reason = route.no_way(self._around, pose)
            if reason is not None:
                self._refuse(reason, dt)
            return False
        if route.values is None and not route.is_drawing:
            route.draw(self._around)
        if route.is_drawing:
            route.work(pose, round(AT_ONCE * SLICE))
            if route.is_drawing or not route.is_settled:
                return False
        elif not route.settle(self._around, pose):
            return False
        if route.left(pose) == math.inf:
            self._refuse(route.no_way(self._around, pose), dt)
            return False
        self._is_new = False
        return True

    def _refuse(self, reason: str, dt: float) -> None:
        """
        Refuse the goal, unless marks may be why: forget those out of sight, and try again.

        Marks that are in sight may be why while people are about, who go away.
        """
        self._refused_for += dt
        route, layer, may_clear = self._route, self._around.layer, False
        assert route is not None
        if layer.marks.any():
            layer.forget()
            may_clear = self._around.movers.are_about or layer.is_new
        is_possible = route.may_be_unknown or self._may_aim(route.asked)
        if not (may_clear and is_possible) or self._refused_for > _FOR_PEOPLE:
            self._end('refused', reason)
            return
        self._held_back = 0.0 if layer.is_new else _AGAIN
        self.state, self.reason = 'recovering', f'{reason}{_WAITING}'
        self._is_checked = False
        self.local_path = np.empty((0, 2))
        self._route = self._route_to(route.asked, route.may_be_unknown)

    def _may_aim(self, goal: np.ndarray) -> bool:
        """Whether a place near an impossible goal may be the goal: it is on the map."""
        is_map = min(self._around.grid.cells.shape) >= FEWEST
        return is_map and bool(np.isfinite(goal).all()) and self._around.whole.has(goal[:2])

    def _may_dock(self, state: np.ndarray) -> Docking | None:
        """Return a straight way to the goal, if it is free."""
        assert self._route is not None
        scene, parameters = self._scene(self._route), self._parameters
        tolerances = parameters.xy_goal_tolerance, parameters.yaw_goal_tolerance
        docking = Docking(self._route.goal, self._base, tolerances)
        around = scene.distances, scene.circles
        return docking if docking.is_free(state, around, _KEPT * parameters.margin) else None

    def _dock(self, docking: Docking, state: np.ndarray, dt: float) -> np.ndarray:
        velocity = docking.step(state, dt)
        self.local_path = np.stack((state[:2], docking.goal[:2]))
        self.state, self.reason = ('driving' if docking.is_going else 'turning'), ''
        if not docking.is_there:
            return velocity
        route = self._route
        assert route is not None
        if route.is_to_look:
            self._no_nearer = 0.0
            self.state, self.reason = 'recovering', f'{route.refusal(self._around)}{_WAITING}'
            return velocity
        off = route.off
        words = f'as near as possible: {off:.2f} m from it' if off > 0.0 else ''
        return self._end('arrived', words)

    def _end(self, state: str, reason: str) -> np.ndarray:
        self.state, self.reason = state, reason
        self.local_path = np.empty((0, 2))
        return np.zeros(3)

    def _may_still_be(self, route: Route, dt: float) -> bool:
        """Whether a goal in unseen space may be reachable, by the present map."""
        around = self._around
        if around.known > self._known + _NEWS and self._to_look(route):
            self._known = around.known
            self._start_over()
        is_near = self._docking is not None and self._docking.is_there
        is_seen = is_near if route.is_to_look else route.off == 0.0
        reason = route.refusal(around) if is_seen else None
        self._seen_for = self._seen_for + dt if reason is not None else 0.0
        has_gone = route.is_to_look and not around.layer.has_hit(route.asked[:2], route.off)
        most = _FOR_PEOPLE if around.movers.are_about or has_gone else _SEEN_FOR
        if reason is None or self._seen_for <= most:
            return True
        self._end('failed', reason)
        return False

    def _start_over(self) -> None:
        """Count time without progress from now."""
        self._least_left, self._no_nearer, self._in_a_row = math.inf, 0.0, 0

    def _watch(self, left: float, dt: float) -> None:
        """Recover when it has come no nearer for long."""
        if left < self._least_left - _NEARER:
            if self._least_left == math.inf:
                self._first_left = left  # since the last recovery
            elif left < self._first_left - _PAST:
                self._in_a_row = 0
            self._least_left, self._no_nearer = left, 0.0
            return
        self._no_nearer += dt
        patience = self._parameters.stuck_time * (1.0 if self._docking is None else 3.0)
        if self._no_nearer > patience:
            self._begin_recovery(f'came no nearer than {self._least_left:.2f} m')

    def _begin_recovery(self, why: str) -> None:
        most = self._parameters.recoveries
        if self._route is not None and self._to_look(self._route):
            most = min(most, _UNSEEN)  # there are other places to look from
        if self._around.movers.are_about:
            most *= _WITH_PEOPLE
        if self._in_a_row >= most or self.recoveries >= _IN_ALL * most:
            self._end('failed', f'{why}, after {self.recoveries} recoveries')
            return
        self._manoeuvre = choose_manoeuvre(self._in_a_row, self._limits)
        self._manoeuvred = 0.0
        self._in_a_row += 1
        self.recoveries += 1
        self._docking = None
        self.state, self.reason = 'recovering', f'{why}: {self._manoeuvre.what}'
        self.local_path = np.empty((0, 2))

    def _recover(self, dt: float) -> np.ndarray:
        manoeuvre = self._manoeuvre
        assert manoeuvre is not None
        self._manoeuvred += dt
        if self._manoeuvred < manoeuvre.duration:
            return manoeuvre.velocity
        self._manoeuvre = None
        self._sampler.reset()
        self._no_nearer = 0.0
        self._least_left = math.inf
        return np.zeros(3)

    def _wait(self, dt: float) -> np.ndarray:
        """Stand while no way leads to the goal; look around for one at times, then give up."""
        route = self._route
        assert route is not None
        assert self._pose is not None
        self._docking = None
        self.local_path = np.empty((0, 2))
        if self.state != 'recovering' or not self.reason.endswith(_WAITING):
            reason = route.no_way(self._around, self._pose)
            self.state, self.reason = 'recovering', f'{reason}{_WAITING}'
        self._no_nearer += dt
        if self._no_nearer <= _WAIT:
            return np.zeros(3)
        self._no_nearer = 0.0
        self._around.layer.forget()
        self._begin_recovery(self.reason.removesuffix(_WAITING))
        # Somebody may wait for room himself, as before a door that the robot stands in.
        if not (self._is_hemmed_in() or self._around.movers.are_about):
            self._manoeuvre = None
        return np.zeros(3)

    def _is_hemmed_in(self) -> bool:
        """Whether something is so near that the robot has to get off first."""
        assert self._pose is not None
        circles, margin = self._footprint.circles, self._parameters.margin
        return bool(clearance(self._around.distances, circles, self._pose, margin) < margin)
