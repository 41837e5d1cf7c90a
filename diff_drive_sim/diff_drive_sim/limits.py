# SPDX-License-Identifier: Apache-2.0
"""Velocity of one axis on its way to a target, with bounded acceleration and jerk."""

from dataclasses import dataclass
import math
from typing import NamedTuple

NAN = float('nan')


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

    @property
    def mirrored(self) -> 'AxisLimits':
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


@dataclass
class AxisRamp:
    """One axis: its velocity and, while jerk is bounded, its acceleration."""

    limits: AxisLimits
    velocity: float = 0.0
    acceleration: float = 0.0

    def step(self, target: float, dt: float) -> float:
        """Return the velocity `dt` [s] later, moving towards `target`; a `dt` of 0 keeps it."""
        if dt <= 0.0:
            return self.velocity
        limits = self.limits
        if math.isinf(limits.rise) and math.isinf(limits.fall):
            self.velocity = _approach(self.velocity, target, limits, dt)
            self.acceleration = 0.0
        else:
            self._step_smoothly(target, dt)
        return self.velocity

    def _step_smoothly(self, target: float, dt: float) -> None:
        """
        Change the acceleration by the jerk's bounds only, such that it ends with the ramp.

        It may be as large as can be brought to 0 by the time the target is reached. Solved for a
        rising velocity; a falling one is its mirror image.
        """
        sign = 1.0 if target >= self.velocity else -1.0
        limits = self.limits if sign > 0.0 else self.limits.mirrored
        velocity, acceleration = sign * self.velocity, sign * self.acceleration
        rest = sign * target - velocity
        wanted = min(_ramp_down(rest, limits.fall, dt), _largest(velocity, limits, dt))
        change = wanted - acceleration
        change = max(-limits.fall * dt, min(limits.rise * dt, change))
        acceleration += change
        if acceleration * dt >= rest and rest <= 1.000001 * limits.fall * dt * dt:
            # The last step: what it takes can end with it.
            velocity, acceleration = sign * target, 0.0
        else:
            velocity += acceleration * dt
        self.velocity, self.acceleration = sign * velocity, sign * acceleration


def _first(*values: float) -> float:
    """Return the magnitude of the first value that is not NaN, else infinity."""
    return next((abs(value) for value in values if not math.isnan(value)), math.inf)


def _approach(velocity: float, target: float, limits: AxisLimits, dt: float) -> float:
    """Return the velocity nearest to the target after `dt` [s], changing limits at 0."""
    if target < velocity:
        return -_approach(-velocity, -target, limits.mirrored, dt)
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
    Return the largest acceleration that can end within `rest` of velocity, in whole steps.

    In n steps of `fall dt` down to 0 the velocity changes by up to n (n + 1) / 2 fall dt^2.
    """
    if math.isinf(fall) or rest <= 0.0:
        return math.inf if rest > 0.0 else 0.0
    step = fall * dt
    count = math.ceil(0.5 * (math.sqrt(1.0 + 8.0 * rest / (step * dt)) - 1.0) - 1e-9)
    count = max(1, count)
    return rest / (count * dt) + 0.5 * (count - 1) * step


def _largest(velocity: float, limits: AxisLimits, dt: float) -> float:
    """Return the largest acceleration of a rising velocity, with the next limit in view at 0."""
    if velocity >= 0.0:
        return limits.speed_up
    if limits.speed_up >= limits.slow_down_backward or math.isinf(limits.fall):
        return limits.slow_down_backward
    rest = max(0.0, -velocity - limits.slow_down_backward * dt)
    crossing = math.sqrt(limits.speed_up**2 + 2.0 * limits.fall * rest)
    return min(limits.slow_down_backward, crossing)
