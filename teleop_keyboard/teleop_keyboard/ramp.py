# SPDX-License-Identifier: Apache-2.0
"""Velocities of a teleoperated robot and how fast they may change."""

from dataclasses import dataclass
from typing import NamedTuple

# Closer than this a ramp has arrived; rounding must not cost another step [m/s or rad/s].
ARRIVED = 1e-12


class Velocity(NamedTuple):
    """In the robot's frame: forward, left and up [m/s], counter-clockwise [rad/s]."""

    vx: float = 0.0
    vy: float = 0.0
    vz: float = 0.0
    wz: float = 0.0


STANDSTILL = Velocity()


def ramped_velocity(previous: float, target: float, acceleration: float, dt: float) -> float:
    """
    Velocity reachable from `previous` in `dt` [s], moving toward `target`.

    `acceleration` is a magnitude and holds for speeding up and for braking: a command that was
    held for T covers target * T, however long its ramps are. A `dt` of 0 returns `previous`.
    """
    step = acceleration * dt
    error = abs(target - previous)
    if error < step or error - step < ARRIVED:
        return target
    return previous + step if target > previous else previous - step


@dataclass(frozen=True, kw_only=True)
class Pace:
    """How fast the axes may change [m/s^2], [rad/s^2]: away from zero, toward it, to a stop."""

    linear_accel: float
    angular_accel: float
    linear_decel: float
    angular_decel: float
    linear_stop: float
    angular_stop: float
    keep_direction: bool = False


def ramped_twist(previous: Velocity, target: Velocity, pace: Pace, dt: float) -> Velocity:
    """
    Return the velocity reachable from `previous` in `dt` [s], moving toward `target`.

    Each axis has its own ramp; with `keep_direction` all arrive together with the slowest. A
    reversal brakes to zero first, at the pace of braking.
    """
    is_stop = target == STANDSTILL
    linear = pace.linear_accel, pace.linear_stop if is_stop else pace.linear_decel
    angular = pace.angular_accel, pace.angular_stop if is_stop else pace.angular_decel
    limits = linear, linear, linear, angular
    axes = [
        _axis(before, after, accel, decel, dt)
        for before, after, (accel, decel) in zip(previous, target, limits, strict=True)
    ]
    if not pace.keep_direction:
        return Velocity(*axes)
    # The share of its way that an axis covers; the smallest holds for all.
    ways = zip(previous, target, axes, strict=True)
    share = min(
        (
            (reached - before) / (after - before)
            for before, after, reached in ways
            if after != before
        ),
        default=1.0,
    )
    if share >= 1.0 - ARRIVED:
        return target
    return Velocity(*(b + share * (a - b) for b, a in zip(previous, target, strict=True)))


def _axis(previous: float, target: float, accel: float, decel: float, dt: float) -> float:
    """Ramp one axis, which brakes while it moves toward zero."""
    if accel == decel or previous * target > 0.0 and abs(target) > abs(previous):
        return ramped_velocity(previous, target, accel, dt)
    if previous == 0.0 or decel <= 0.0:
        return ramped_velocity(previous, target, accel, dt)
    floor = target if previous * target > 0.0 else 0.0
    reached = ramped_velocity(previous, floor, decel, dt)
    left = dt - abs(previous - reached) / decel
    if reached != floor or left <= 0.0 or floor == target:
        return reached
    return ramped_velocity(floor, target, accel, left)
