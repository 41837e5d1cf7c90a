# SPDX-License-Identifier: Apache-2.0
"""Velocities of a teleoperated robot and how fast they may change."""

from typing import NamedTuple

# Closer than this a ramp has arrived; rounding must not cost another step [m/s or rad/s].
ARRIVED = 1e-12


class Twist3(NamedTuple):
    """Planar velocity in the robot's frame: forward and left [m/s], counter-clockwise [rad/s]."""

    vx: float = 0.0
    vy: float = 0.0
    wz: float = 0.0


STANDSTILL = Twist3()


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


def ramped_twist(
    previous: Twist3, target: Twist3, linear: float, angular: float, dt: float
) -> Twist3:
    """Apply the ramp to each axis; `linear` [m/s^2] and `angular` [rad/s^2] are magnitudes."""
    return Twist3(
        ramped_velocity(previous.vx, target.vx, linear, dt),
        ramped_velocity(previous.vy, target.vy, linear, dt),
        ramped_velocity(previous.wz, target.wz, angular, dt),
    )
