# SPDX-License-Identifier: Apache-2.0
"""
Velocity of one axis on its way to a target, with bounded acceleration and jerk.

The jerk of a step is the change of the acceleration from the step before, over the time of this
one. Nobody knows how long the steps to come will be, so a state (v, a) is entered only if easing
off from it, the acceleration brought to 0 as fast as jerk allows, breaks no limit. In continuous
time the velocity changes by a^2 / (2 jerk) on the way; in steps of any length, each with the
acceleration of its end, by less. So easing off stays possible for ever, and by it the limits hold.
"""

from dataclasses import dataclass
import math
from typing import NamedTuple

from robot_description.morphology.equip_wheels import Strength

from diff_drive_sim.odometry import DiffDriveGeometry

NAN = float('nan')
# What easing off may change a velocity that counts as reached [m/s or rad/s].
ARRIVED = 1e-13
# Where there is no limit of a velocity, no robot is faster [m/s or rad/s].
FASTEST = 100.0


class AxisLimits(NamedTuple):
    """
    Magnitudes, infinite where there is no limit.

    `forward` and `backward` bound the velocity; the accelerations are those that speed up and
    slow down, when going forward and backward; `rise` and `fall` bound the jerk.
    """

    forward: float = math.inf
    backward: float = math.inf
    speed_up: float = math.inf
    slow_down: float = math.inf
    speed_up_backward: float = math.inf
    slow_down_backward: float = math.inf
    rise: float = math.inf
    fall: float = math.inf

    @classmethod
    def from_signed(
        cls,
        max_velocity: float = NAN,
        min_velocity: float = NAN,
        max_acceleration: float = NAN,
        max_deceleration: float = NAN,
        max_acceleration_reverse: float = NAN,
        max_deceleration_reverse: float = NAN,
        max_jerk: float = NAN,
        min_jerk: float = NAN,
    ) -> 'AxisLimits':
        """Return limits given as by ros2_controllers: signed, NaN for the mirrored or none."""
        slow_down = _first(max_deceleration, max_acceleration)
        return cls(
            _first(max_velocity),
            _first(min_velocity, max_velocity),
            _first(max_acceleration),
            slow_down,
            _first(max_acceleration_reverse, max_acceleration),
            _first(max_deceleration_reverse, slow_down),
            _first(max_jerk),
            _first(min_jerk, max_jerk),
        )

    def share(self, velocity: float) -> float:
        """Return the largest factor up to 1 by which a velocity is within the limits."""
        limit = self.forward if velocity > 0.0 else self.backward
        return limit / abs(velocity) if abs(velocity) > limit else 1.0

    def within(self, strength: Strength) -> 'AxisLimits':
        """Return the limits with no acceleration beyond what motors can do; none stays none."""
        bounded = zip(self[2:6], self.reached_by(strength)[2:6], strict=True)
        accelerations = (most if math.isfinite(limit) else limit for limit, most in bounded)
        return AxisLimits._make((*self[:2], *accelerations, *self[6:]))

    def reached_by(self, strength: Strength) -> 'AxisLimits':
        """Return the limits with the accelerations that motors can do, also where none was set."""
        accelerations = map(min, self[2:6], (*strength, *strength))
        return AxisLimits._make((*self[:2], *accelerations, *self[6:]))

    @property
    def has_jerk(self) -> bool:
        """Whether jerk has a limit."""
        return math.isfinite(self.rise) or math.isfinite(self.fall)

    @property
    def braking_delay(self) -> float:
        """
        How much longer than at once a stop takes for jerk, at most [s].

        First speeding up ends; then braking begins and ends, of which half counts: v^2 / (2 a) +
        v a / (2 j) is the way of such a stop from v, or more.
        """
        jerk = min(self.rise, self.fall)
        if math.isinf(jerk):
            return 0.0
        # Of a speed no ramp reaches more than this.
        most = math.sqrt(min(max(self.forward, self.backward), FASTEST) * jerk)
        speed_up = min(max(self.speed_up, self.speed_up_backward), most)
        slow_down = min(max(self.slow_down, self.slow_down_backward), most)
        return (speed_up + 0.5 * slow_down) / jerk

    @property
    def for_reverse(self) -> 'AxisLimits':
        """The limits with forward and backward exchanged."""
        return AxisLimits(
            self.backward,
            self.forward,
            self.speed_up_backward,
            self.slow_down_backward,
            self.speed_up,
            self.slow_down,
            self.fall,
            self.rise,
        )


class Motion(NamedTuple):
    """A velocity and the acceleration at which it was reached, 0 where jerk has no limit."""

    velocity: float = 0.0
    acceleration: float = 0.0


@dataclass
class AxisRamp:
    """One axis: its velocity and, while jerk is bounded, its acceleration."""

    limits: AxisLimits
    velocity: float = 0.0
    acceleration: float = 0.0

    def step(self, target: float, dt: float) -> float:
        """Return the velocity `dt` [s] later, moving towards `target`; a `dt` of 0 keeps it."""
        if dt > 0.0:
            self.take(self.toward(target, dt))
        return self.velocity

    def take(self, motion: Motion) -> None:
        """Go on from a motion."""
        self.velocity, self.acceleration = motion

    def toward(self, target: float, dt: float) -> Motion:
        """Return the motion after `dt` > 0 [s] towards a target within the velocity limits."""
        limits = self.limits
        if not limits.has_jerk:
            return Motion(_approach(self.velocity, target, limits, dt))
        rest = target - self.velocity
        if rest >= 0.0:
            wanted = _ramp_down(rest, limits.fall, dt)
        else:
            wanted = -_ramp_down(-rest, limits.rise, dt)
        acceleration = self._within_jerk(self._within_limits(wanted, dt), dt)
        if acceleration == rest / dt:
            return Motion(target, acceleration)
        return Motion(self.velocity + acceleration * dt, acceleration)

    def hold(self, dt: float) -> Motion:
        """Return the motion after `dt` [s] of easing off; it breaks no limit."""
        if not self.limits.has_jerk:
            return Motion(self.velocity)
        acceleration = self._within_jerk(0.0, dt)
        return Motion(self.velocity + acceleration * dt, acceleration)

    def span(self, motion: Motion) -> tuple[float, float]:
        """Return the velocities between which easing off from a motion stays."""
        velocity, acceleration = motion
        if acceleration > 0.0:
            return velocity, velocity + acceleration**2 / (2.0 * self.limits.fall)
        return velocity - acceleration**2 / (2.0 * self.limits.rise), velocity

    def confine(self, motion: Motion, low: float, high: float, dt: float) -> Motion:
        """
        Return the motion nearest to one whose span is within bounds.

        Bounds that easing off does not keep, either, are widened to what it needs. So the result
        is between `hold` and the motion, and breaks no limit where these break none.
        """
        least, most = self.span(self.hold(dt))
        low, high = min(low, least), max(high, most)
        if not self.limits.has_jerk:
            return Motion(min(max(motion.velocity, low), high))
        if low <= self.span(motion)[0] and self.span(motion)[1] <= high:
            return motion
        lowest = -_largest(self.velocity - low, self.limits.rise, dt)
        highest = _largest(high - self.velocity, self.limits.fall, dt)
        acceleration = min(max(motion.acceleration, lowest), highest)
        # Rounding must not cost the jerk: holding has the last word.
        ends = sorted((self.hold(dt).acceleration, motion.acceleration))
        acceleration = min(max(acceleration, ends[0]), ends[1])
        return Motion(self.velocity + acceleration * dt, acceleration)

    def _within_jerk(self, acceleration: float, dt: float) -> float:
        """Return the acceleration nearest to one that jerk allows in the next step."""
        lowest = self.acceleration - self.limits.fall * dt
        highest = self.acceleration + self.limits.rise * dt
        return min(max(acceleration, lowest), highest)

    def _within_limits(self, acceleration: float, dt: float) -> float:
        """Return the acceleration nearest to one that velocity and acceleration limits allow."""
        lowest = -_most(-self.velocity, self.limits.for_reverse, dt)
        return min(max(acceleration, lowest), _most(self.velocity, self.limits, dt))


def _first(*values: float) -> float:
    """Return the magnitude of the first value that is not NaN, else infinity."""
    return next((abs(value) for value in values if not math.isnan(value)), math.inf)


def _approach(velocity: float, target: float, limits: AxisLimits, dt: float) -> float:
    """Return the velocity nearest to the target after `dt` [s], changing limits at 0."""
    if target < velocity:
        return -_approach(-velocity, -target, limits.for_reverse, dt)
    if velocity < 0.0:  # slowing down, up to 0
        stop = min(target, 0.0)
        step = limits.slow_down_backward * dt
        if velocity + step <= stop:
            return velocity + step
        dt -= (stop - velocity) / limits.slow_down_backward
        velocity = stop
    return min(target, velocity + limits.speed_up * dt) if target > velocity else velocity


def _ramp_down(rest: float, fall: float, dt: float) -> float:
    """
    Return the largest acceleration that can end within `rest` of velocity, in steps of `dt`.

    In n steps of `fall dt` down to 0 the velocity changes by up to n (n + 1) / 2 fall dt^2. Where
    shorter steps follow, it may pass the target by less than one step's change, but no limit.
    """
    if math.isinf(fall) or rest <= 0.0:
        return rest / dt
    step = fall * dt
    ratio = min(rest / (step * dt), 1e18)  # of what no count of steps can tell apart
    count = math.ceil(0.5 * (math.sqrt(1.0 + 8.0 * ratio) - 1.0) - 1e-9)
    count = max(1, count)
    return rest / (count * dt) + 0.5 * (count - 1) * step


def _largest(rest: float, fall: float, dt: float) -> float:
    """
    Return the largest acceleration of a step that can end within `rest` of velocity.

    It solves a dt + a^2 / (2 fall) = rest: what the step itself and easing off from it take.
    """
    straight = rest / dt
    if straight <= 0.0 or straight * straight <= 2.0 * fall * ARRIVED:
        return straight
    return 2.0 * rest / (dt + math.sqrt(dt * dt + 2.0 * rest / fall))


def _most(velocity: float, limits: AxisLimits, dt: float) -> float:
    """Return the largest acceleration of a step that keeps the limits, and lets keep them."""
    most = limits.speed_up
    if velocity < 0.0:
        # Slowing down; at 0 the acceleration has to be that of speeding up.
        most = limits.slow_down_backward
        if limits.speed_up < most:
            rest = limits.speed_up**2 / (2.0 * limits.fall) - velocity
            most = min(most, max(limits.speed_up, _largest(rest, limits.fall, dt)))
    if limits.forward < math.inf:
        most = min(most, max(0.0, _largest(limits.forward - velocity, limits.fall, dt)))
    return most


class Velocity(NamedTuple):
    """Planar velocity of the middle of the axle, which cannot slide sideways."""

    linear: float = 0.0  # [m/s], forward
    angular: float = 0.0  # [rad/s], counter-clockwise


Span = tuple[float, float]


class PlanarRamp:
    """
    Forward speed and yaw rate, ramped each by its own limits; no wheel is sent too fast.

    The axes share the wheels. Scaling both after the ramp would break their limits, so the wheels
    bound the ramps: a step is taken only if both axes, easing off from it, would stay at what the
    wheels can do (see `limits`). Easing off can be kept up at any time, so this holds for every
    target and every length of steps. The axis that frees the wheels goes first, the other takes
    what that leaves.
    """

    def __init__(self, geometry: DiffDriveGeometry) -> None:
        self.linear, self.angular = AxisRamp(AxisLimits()), AxisRamp(AxisLimits())
        self._lever = 0.5 * geometry.wheel_separation
        self._left = geometry.speed_limit * geometry.left_radius  # [m/s] of the rim
        self._right = geometry.speed_limit * geometry.right_radius

    def reset(self) -> None:
        """Stand."""
        self.linear.take(Motion())
        self.angular.take(Motion())

    def step(self, linear: float, angular: float, dt: float) -> Velocity:
        """Return the velocity `dt` [s] later; a `dt` of 0 keeps it."""
        if dt > 0.0:
            forward, turn = self.linear.toward(linear, dt), self.angular.toward(angular, dt)
            if not self._fits(self.linear.span(forward), self.angular.span(turn)):
                forward, turn = self._within_wheels(forward, turn, dt)
            self.linear.take(forward)
            self.angular.take(turn)
        return Velocity(self.linear.velocity, self.angular.velocity)

    def _fits(self, forward: Span, turn: Span) -> bool:
        """Whether both wheels can do all that is within two spans."""
        slowest, fastest = self._forward_bounds(turn)
        return slowest <= forward[0] and forward[1] <= fastest

    def _within_wheels(self, forward: Motion, turn: Motion, dt: float) -> tuple[Motion, Motion]:
        """Return what the wheels can do of two motions, each between it and easing off."""
        span = self.angular.span(self.angular.hold(dt))
        eased = self.linear.confine(forward, *self._forward_bounds(span), dt)
        turn = self.angular.confine(turn, *self._turn_bounds(self.linear.span(eased)), dt)
        # What the turn has given up, or freed, is there for the speed.
        bounds = self._forward_bounds(self.angular.span(turn))
        return self.linear.confine(forward, *bounds, dt), turn

    def _forward_bounds(self, turn: Span) -> Span:
        """Return the slowest and fastest speed [m/s] that the wheels can do with a turn."""
        low, high = self._lever * turn[0], self._lever * turn[1]
        slowest = max(-self._right - low, high - self._left)
        return slowest, min(self._right - high, self._left + low)

    def _turn_bounds(self, forward: Span) -> Span:
        """Return the least and largest yaw rate [rad/s] that the wheels can do with a speed."""
        low, high = forward
        least = max(-self._right - low, high - self._left)
        most = min(self._right - high, self._left + low)
        return least / self._lever, most / self._lever
