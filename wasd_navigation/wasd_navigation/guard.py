# SPDX-License-Identifier: Apache-2.0
"""
Keeps commands from driving a robot into obstacles that its lidar sees.

A command is followed for as much of it as keeps the footprint clear: along the curve that it asks
for (by time to collision, as Nav2's collision monitor), and on the way to a stop from what the
robot does now. What comes no nearer to anything is always allowed.
"""

from collections.abc import Sequence
import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit
from wasd_core.robot_io import BaseOdometry
from wasd_core.rotations import Pose
from wasd_core.timing import Watchdog

from wasd_navigation.guard_parameters import GuardParameters
from wasd_navigation.odometry import leaps, Odometry
from wasd_navigation.parameters import Footprint
from wasd_navigation.records import Scan
from wasd_navigation.se2 import compose, inverse, transform
from wasd_navigation.senses import Senses

# What is hidden from the lidar now is remembered for so long [s], up to so far away [m].
MEMORY, MEMORY_REACH = 10.0, 3.0
# A ray looks so far to both sides: what is farther from all rays is hidden [rad].
RAY = 0.03
# What is deeper in the footprint is a part of the robot [m].
OWN = 0.05
# A motion is tested in steps that move no part of the footprint farther than this [m].
STRIDE = 0.02
# No robot is faster [m/s], [rad/s]: looking ahead would take for ever.
FASTEST = 20.0
# Slower is standing [m/s or rad/s]; and less than this is no nearer [m].
REST, NO_NEARER = 1e-3, 1e-6
# A robot that cannot stop in time goes on no faster than this [m/s].
SLOW = 0.1
# The robot may stop sooner than its sure braking says: by these factors of it (x, y, turn), after
# this share of the reaction time.
SOONER, SOON = np.array((1.0, 2.0, math.inf)), 1.0 / 3.0
# A limited command below this counts as zero [m/s], [rad/s].
LEAST = np.array((0.01, 0.01, 0.02))
# Shares of a command to try, largest first; then so many halvings between two of them.
SHARES, HALVINGS = (1.0, 0.7, 0.4, 0.2, 0.08), 3


class Guarded(NamedTuple):
    """
    A velocity (vx, vy, wz), shape (3,) [m/s, m/s, rad/s], and what the guard did to it.

    `action` is '' where it did nothing, else `stop`, `slowdown` or `approach`; `why` says so in
    words.
    """

    velocity: np.ndarray
    action: str = ''
    why: str = ''


class Body(NamedTuple):
    """A footprint as a rectangle of two half sides, grown by a radius [m]; and its reach [m]."""

    half_length: float
    half_width: float
    radius: float
    reach: float


class Clearance(NamedTuple):
    """
    What has to be kept from each point, shape (n,) [m], and how that grows with the way.

    It grows by `drift` [m/m], as far as that is more than `spare` [m].
    """

    keep: np.ndarray
    drift: float
    spare: float


def body_of(footprint: Footprint) -> Body:
    """Return a footprint as the guard looks at it."""
    half = footprint.half_length, footprint.half_width
    return Body(*half, footprint.radius, math.hypot(*half) + footprint.radius)


class Guard:
    """
    Takes scans with the odometry of their time, and commands; says how much of each is followed.

    It reads no clock: `pass_time` is told what has passed [s]. `braking` are the
    decelerations that the robot is sure to manage (ahead, to the side, turning), shape (3,)
    [m/s^2, m/s^2, rad/s^2].
    """

    def __init__(
        self, footprint: Footprint, braking: np.ndarray, parameters: GuardParameters | None = None
    ) -> None:
        self._body = body_of(footprint)
        self.brake_by(braking)
        self._moved, self._sighted = Watchdog(0.0), Watchdog(0.0)
        self.tune(parameters or GuardParameters())
        self.reset()

    def tune(self, parameters: GuardParameters) -> None:
        """Take other parameters."""
        self._parameters = parameters
        self._moved.timeout = self._sighted.timeout = parameters.source_timeout

    def brake_by(self, braking: Sequence[float] | np.ndarray, delay: float = 0.0) -> None:
        """Take other decelerations, and how long the robot takes to reach them [s]."""
        self._braking, self._delay = np.asarray(braking, float), delay

    def reset(self) -> None:
        """Know of nothing, as if no scan had ever come."""
        self._moved.reset()
        self._sighted.reset()
        self._odometry: Odometry | None = None
        self._points = np.empty((0, 2))  # in the odom frame [m]
        self._ages = np.empty(0)  # since each was seen [s]
        self.last = Guarded(np.zeros(3))

    def move(self, odometry: Odometry) -> bool:
        """
        Take the newest odometry; return whether it has leapt, as when it is set to 0.

        Then what is known keeps its place.
        """
        before, self._odometry = self._odometry, odometry
        has_leapt = before is not None and leaps(before.pose, odometry.pose, self._moved.age)
        if before is not None and has_leapt:
            self._points = transform(compose(odometry.pose, inverse(before.pose)), self._points)
        self._moved.hear()
        return has_leapt

    def see(self, scan: Scan, odometry: Odometry, age: float = 0.0) -> None:
        """Take a scan and the odometry of its time, which is `age` [s] ago."""
        pose = odometry.pose
        is_kept = self._is_hidden(scan, pose) & (self._ages < MEMORY)
        seen: np.ndarray = transform(pose, scan.points)
        self._points = np.concatenate((self._points[is_kept], seen))
        self._ages = np.concatenate((self._ages[is_kept], np.full(len(seen), age)))
        self._sighted.hear(age)

    def _is_hidden(self, scan: Scan, pose: np.ndarray) -> np.ndarray:
        """Return which known points no ray of a scan looks at, shape (n,)."""
        rays = scan.ends - scan.origin
        angles = np.sort(np.arctan2(rays[:, 1], rays[:, 0]))
        to = transform(inverse(pose), self._points) - scan.origin
        is_near = np.hypot(to[:, 0], to[:, 1]) < MEMORY_REACH
        bearings = np.arctan2(to[:, 1], to[:, 0])
        after = np.searchsorted(angles, bearings)
        apart = np.minimum(
            _apart(angles[after % len(angles)], bearings), _apart(angles[after - 1], bearings)
        )
        hidden: np.ndarray = is_near & (apart > RAY)
        return hidden

    def pass_time(self, dt: float) -> None:
        """Let `dt` [s] pass, also where nothing is commanded."""
        self._moved.step(dt)
        self._sighted.step(dt)
        self._ages = self._ages + max(dt, 0.0)

    def step(self, asked: np.ndarray) -> Guarded:
        """Return how much of a command (vx, vy, wz), shape (3,), to follow now."""
        self.last = self._limit(np.array(asked, float))
        return self.last

    def _limit(self, asked: np.ndarray) -> Guarded:
        still = np.zeros(3)
        if not (np.abs(asked) <= FASTEST).all():
            return Guarded(still, 'stop', f'the command is not within {FASTEST:g} m/s and rad/s')
        if not asked.any() or not self._parameters.enabled:
            return Guarded(asked)
        # Odometry first: without it scans wait.
        senses = (
            ('odometry is silent', self._moved),
            ('the lidar is silent or blind', self._sighted),
        )
        for why, heard in senses:
            if not heard.is_alive:
                since = f' for {heard.age:.1f} s' if math.isfinite(heard.age) else ''
                return Guarded(still, 'stop', why + since)
        odometry = self._odometry
        assert odometry is not None
        if not (np.abs(odometry.velocity) <= FASTEST).all():
            return Guarded(still, 'stop', f'odometry is not within {FASTEST:g} m/s and rad/s')
        return self._clear(asked, odometry)

    def _clear(self, asked: np.ndarray, odometry: Odometry) -> Guarded:
        """Return the part of a finite command that keeps clear of known obstacles."""
        parameters, body = self._parameters, self._body
        points = self._near(asked, odometry)
        if not len(points):
            return Guarded(asked)
        keep = np.empty(len(points))
        keep_from(points, body, parameters.footprint_padding, keep)
        # Half of the padding is for the drift of a short way: no gap locks the robot in.
        clearance = Clearance(keep, parameters.drift, 0.5 * parameters.footprint_padding)
        ahead, nearest = time_to_collision(
            points, clearance, body, asked, parameters.time_before_collision
        )
        action, share = '', 1.0
        if ahead < parameters.time_before_collision:
            action = parameters.action_type
            shares = {
                'approach': ahead / parameters.time_before_collision,
                'slowdown': parameters.slowdown_ratio,
                'stop': 0.0,
            }
            share = shares[action]
        share = self._stoppable(points, clearance, odometry.velocity, asked, share)
        velocity = share * asked
        if share == 1.0:
            return Guarded(asked)
        if nearest < 0:  # only the way to a stop is too short
            reaction = parameters.reaction_time + self._delay
            stop = odometry.velocity, asked, self._braking, reaction
            nearest = least_room(points, clearance, body, *stop, True)[1]
        # What waits for the way ahead may turn meanwhile.
        turned = np.array((*velocity[:2], asked[2]))
        if action != 'stop' and asked[2] != 0.0 and asked[:2].any():
            horizon = parameters.time_before_collision
            is_far = time_to_collision(points, clearance, body, turned, horizon)[0] >= horizon
            now = odometry.velocity
            if is_far and self._stoppable(points, clearance, now, turned, 1.0) == 1.0:
                velocity = turned
        if (np.abs(velocity) < LEAST).all():
            velocity, action = np.zeros(3), 'stop'
        return Guarded(velocity, action or 'approach', _say(points[nearest], body))

    def _near(self, asked: np.ndarray, odometry: Odometry) -> np.ndarray:
        """Return what could be met before the robot stands, in the base frame."""
        points = transform(inverse(odometry.pose), self._points)
        fastest = np.maximum(np.abs(asked), np.abs(odometry.velocity))
        speed = math.hypot(fastest[0], fastest[1])
        time = self._parameters.reaction_time + self._delay
        time += speed / float(self._braking[:2].min())
        time = max(time, self._parameters.time_before_collision)
        away = np.hypot(points[:, 0], points[:, 1])
        way = (1.0 + self._parameters.drift) * speed * time
        reach = self._body.reach + self._parameters.footprint_padding + way
        near = points[away < reach + STRIDE]
        others: np.ndarray = near[room_of(near, self._body) > -OWN]
        return others

    def _stoppable(
        self,
        points: np.ndarray,
        clearance: Clearance,
        velocity: np.ndarray,
        asked: np.ndarray,
        most: float,
    ) -> float:
        """Return the largest share up to `most` of a command from which the robot can stop."""
        still = np.zeros(3)
        reaction = self._parameters.reaction_time
        sure = self._braking, reaction + self._delay
        soon = SOONER * self._braking, SOON * reaction

        def least(
            now: np.ndarray, wanted: np.ndarray, is_quick: bool, how: tuple[np.ndarray, float]
        ) -> float:
            body = self._body
            return least_room(points, clearance, body, now, wanted, *how, is_quick)[0]

        # If it cannot stop in time, any motion that ends no nearer than a stop is allowed.
        enough = min(0.0, least(velocity, still, True, (self._braking, self._delay))) - NO_NEARER
        slow = SLOW / np.array((1.0, 1.0, self._body.reach))
        goes_on = bool(((asked * velocity > 0.0) & (np.abs(velocity) > slow)).any())

        def is_clear(share: float) -> bool:
            wanted = share * asked
            if goes_on and enough < -NO_NEARER:
                return False
            if least(still, wanted, True, sure) < -NO_NEARER:
                return False
            # The next command may be a stop: a turn that is broken off leads elsewhere.
            return all(
                least(velocity, wanted, is_quick, how) >= enough
                for is_quick in (True, False)
                for how in (sure, soon)
            )

        if most > 0.0 and is_clear(most):
            return most
        bad = most
        for share in SHARES:
            if share < most:
                if is_clear(share):
                    for _ in range(HALVINGS):
                        middle = 0.5 * (share + bad)
                        share, bad = (middle, bad) if is_clear(middle) else (share, middle)
                    return share
                bad = share
        return 0.0


class GuardSenses(Senses):
    """The senses of a guard: they give it scans, and tell it that odometry has leapt."""

    def __init__(self, guard: Guard) -> None:
        super().__init__()
        self._guard = guard
        self.on_scan = lambda scan, odometry, age, _: guard.see(scan, odometry, age)

    def take_odometry(self, now: float, base: BaseOdometry, frames: tuple[str, str]) -> None:
        """Take odometry of a time [s]; `frames` are odom's and the base's."""
        odometry = self.read_odometry(now, base, frames)
        if odometry is None:
            return
        if self._guard.move(odometry):
            self.forget_odometry(now)
        self.add_odometry(now, odometry)

    def reset(self) -> None:
        """Forget what was sensed, as the guard does."""
        super().reset()
        self._guard.reset()


def warm_up(footprint: Footprint) -> None:
    """Compile all that a guard needs, before a robot waits for it."""
    guard = Guard(footprint, np.ones(3))
    points = np.array(((footprint.inscribed + 0.1, 0.0), (1.0, 1.0)))
    scan = Scan(np.zeros(2), points, np.ones(2, np.bool_))
    here = Odometry(np.zeros(3), np.zeros(3), np.eye(3), Pose(np.zeros(3), np.eye(3)))
    guard.move(here)
    guard.see(scan, here)
    guard.step(np.array((1.0, 0.0, 1.0)))


def _apart(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the angles between directions [rad], from 0 to pi."""
    apart: np.ndarray = np.abs((first - second + math.pi) % (2.0 * math.pi) - math.pi)
    return apart


def _say(point: np.ndarray, body: Body) -> str:
    """Return where what is met first is, in words."""
    bearing = math.degrees(math.atan2(point[1], point[0]))
    sides = ('ahead', 'to the left', 'behind', 'to the right')
    side = sides[round(bearing / 90.0) % 4]
    room = max(0.0, float(room_of(point[None], body)[0]))
    return f'something is {room:.2f} m {side}'


@jit
def room_of(points: np.ndarray, body: Body) -> np.ndarray:
    """Return how far points (x, y), shape (n, 2), are from a footprint [m]; negative inside."""
    rooms = np.empty(points.shape[0])
    for index in range(points.shape[0]):
        rooms[index] = _room(points[index, 0], points[index, 1], body)
    return rooms


@jit
def _room(x: float, y: float, body: Body) -> float:
    out, side = abs(x) - body.half_length, abs(y) - body.half_width
    outside = math.hypot(max(out, 0.0), max(side, 0.0))
    return outside + min(max(out, side), 0.0) - body.radius


@jit
def keep_from(points: np.ndarray, body: Body, padding: float, keep: np.ndarray) -> None:
    """
    Write what has to be kept from each point, shape (n,) [m].

    That is the padding; a robot in a gap that is narrower keeps what it has, down to half of it.
    From what is nearer than that it may only go away.
    """
    least = padding
    for index in range(points.shape[0]):
        keep[index] = _room(points[index, 0], points[index, 1], body)
        least = min(least, keep[index])
    least = max(least, 0.5 * padding)
    for index in range(points.shape[0]):
        keep[index] = min(keep[index], least)


@jit
def _still_to_keep(clearance: Clearance, index: int, way: float) -> float:
    """Return what has to be kept from a point after a way [m]."""
    growth = max(0.0, clearance.drift * way - clearance.spare)
    kept: float = clearance.keep[index] + growth
    return kept


@jit
def time_to_collision(
    points: np.ndarray, clearance: Clearance, body: Body, twist: np.ndarray, horizon: float
) -> tuple[float, int]:
    """
    Return the time [s] after which a constant twist meets a point, and which; `horizon`: none.

    The footprint is swept along the curve of the twist; of two looks the second meets, the time is
    in between.
    """
    pace = math.hypot(twist[0], twist[1])
    speed = pace + abs(twist[2]) * body.reach
    step = min(STRIDE / max(speed, 1e-6), horizon)
    nearer = STRIDE * (1.0 + clearance.drift)
    count = int(math.ceil(horizon / step))
    first, which = horizon, -1
    for index in range(points.shape[0]):
        before = _room(points[index, 0], points[index, 1], body) - clearance.keep[index]
        # No point comes nearer faster than the fastest part of the footprint.
        number = 1 + max(0, int(before / nearer) - 1)
        before_at = 0.0
        while number <= count and (number - 1) * step < first:
            at = number * step
            x, y = _seen_from(points[index, 0], points[index, 1], twist, at)
            room = _room(x, y, body) - _still_to_keep(clearance, index, pace * at)
            if room < -NO_NEARER:
                met = before_at
                if before > 0.0:
                    met = before_at + (at - before_at) * before / (before - room)
                if met < first or which < 0:
                    first, which = met, index
                break
            before, before_at = room, at
            number += 1 + max(0, int(room / nearer) - 1)
    return first, which


@jit
def _seen_from(x: float, y: float, twist: np.ndarray, time: float) -> tuple[float, float]:
    """Return where a point is in the base frame after a time of a constant twist."""
    turn = twist[2] * time
    if abs(turn) < 1e-6:
        along, aside = twist[0] * time, twist[1] * time
    else:
        sin, cos = math.sin(turn) / twist[2], (1.0 - math.cos(turn)) / twist[2]
        along, aside = sin * twist[0] - cos * twist[1], cos * twist[0] + sin * twist[1]
    x, y = x - along, y - aside
    return math.cos(turn) * x + math.sin(turn) * y, math.cos(turn) * y - math.sin(turn) * x


@jit
def least_room(
    points: np.ndarray,
    clearance: Clearance,
    body: Body,
    velocity: np.ndarray,
    asked: np.ndarray,
    braking: np.ndarray,
    reaction: float,
    is_quick: bool,
) -> tuple[float, int]:
    """
    Return the least spare room [m] until the robot stands, and to which point.

    From a velocity it follows a command for the reaction time, then brakes. What it is asked to do
    more than it does now it does at once if it `is_quick`, else only as fast as it brakes.
    """
    now = np.empty(3)
    for axis in range(3):
        is_on = velocity[axis] * asked[axis] >= 0.0 and abs(asked[axis]) > abs(velocity[axis])
        now[axis] = asked[axis] if is_on and is_quick else velocity[axis]
    x = y = yaw = passed = way = 0.0
    least, which = math.inf, -1
    for index in range(points.shape[0]):
        room = _room(points[index, 0], points[index, 1], body) - clearance.keep[index]
        if room < least:
            least, which = room, index
    while passed < reaction or max(max(abs(now[0]), abs(now[1])), abs(now[2])) > REST:
        speed = math.hypot(now[0], now[1]) + abs(now[2]) * body.reach
        dt = min(STRIDE / max(speed, 1e-6), 0.05)
        for axis in range(3):
            most = braking[axis] * dt
            is_against = now[axis] * asked[axis] < 0.0
            if passed >= reaction or is_against:
                slower = abs(now[axis]) - most
                if slower > 0.0:
                    now[axis] = math.copysign(slower, now[axis])
                else:
                    now[axis] = asked[axis] if is_quick and passed < reaction else 0.0
            elif abs(asked[axis]) > abs(now[axis]):
                now[axis] += min(max(asked[axis] - now[axis], -most), most)
        half = yaw + 0.5 * now[2] * dt
        x += (math.cos(half) * now[0] - math.sin(half) * now[1]) * dt
        y += (math.sin(half) * now[0] + math.cos(half) * now[1]) * dt
        yaw += now[2] * dt
        passed += dt
        way += math.hypot(now[0], now[1]) * dt
        cos, sin = math.cos(yaw), math.sin(yaw)
        for index in range(points.shape[0]):
            to_x, to_y = points[index, 0] - x, points[index, 1] - y
            room = _room(cos * to_x + sin * to_y, cos * to_y - sin * to_x, body)
            room -= _still_to_keep(clearance, index, way)
            if room < least:
                least, which = room, index
        if passed > 10.0:
            break
    return least, which
