# SPDX-License-Identifier: Apache-2.0
"""Velocity commands to wheel speeds: time-out, limits, kinematics, odometry."""

import math
from typing import NamedTuple

from diff_drive_sim.geometry import DiffDriveGeometry
from diff_drive_sim.odometry import OdometryState
from diff_drive_sim.odometry import WheelOdometry
from diff_drive_sim.parameters import DiffDriveParameters


class Velocity(NamedTuple):
    """Planar velocity of a robot that cannot slide sideways."""

    linear: float = 0.0  # [m/s], forward
    angular: float = 0.0  # [rad/s], counter-clockwise


class DiffDriveController:
    """
    Follows the last velocity command with bounded velocity and acceleration.

    Keeps the command and its age, the velocity reached so far and the odometry. One `step` is
    one control period: wheel angles in, wheel speeds out.
    """

    def __init__(self, geometry: DiffDriveGeometry, parameters: DiffDriveParameters) -> None:
        self.geometry = geometry
        self.parameters = parameters
        self.odometry = WheelOdometry(geometry)
        self.refused_commands = 0
        self.reset()

    def reset(self) -> None:
        """Stand still at the origin, with no command."""
        self.odometry.reset()
        self.velocity = Velocity()
        self._wanted = Velocity()
        self._age = math.inf

    @property
    def target(self) -> Velocity:
        """The command in force: the last one within the limits, or zero when it is too old."""
        return Velocity() if self.timed_out else self._wanted

    @property
    def timed_out(self) -> bool:
        """Whether there has been no command for longer than the time-out."""
        timeout = self.parameters.cmd_vel_timeout
        return self._age > timeout > 0.0 or math.isinf(self._age)

    @property
    def state(self) -> str:
        """`driving`, `stopped`, or `timed out` when it stops because commands have ceased."""
        if self.velocity == Velocity() and self.target == Velocity():
            return 'stopped'
        return 'timed out' if self.timed_out else 'driving'

    def command(self, linear: float, angular: float) -> bool:
        """
        Take a velocity command [m/s], [rad/s] and return whether it was taken.

        One that is not finite is refused and the previous one stays; others are clipped to the
        velocity limits.
        """
        if not (math.isfinite(linear) and math.isfinite(angular)):
            self.refused_commands += 1
            return False
        limits = self.parameters
        self._wanted = Velocity(
            _clip(linear, limits.linear_velocity), _clip(angular, limits.angular_velocity)
        )
        self._age = 0.0
        return True

    def step(self, left: float, right: float, dt: float) -> tuple[float, float]:
        """
        Return left and right wheel speed [rad/s] for the next `dt` [s].

        `left`, `right` are the wheel angles now [rad].
        """
        limits = self.parameters
        target = self.target
        self.velocity = Velocity(
            _approach(self.velocity.linear, target.linear, limits.linear_acceleration * dt),
            _approach(self.velocity.angular, target.angular, limits.angular_acceleration * dt),
        )
        self._age += dt
        self.odometry.step(left, right, dt)
        return self.geometry.wheel_speeds(*self.velocity)

    @property
    def odometry_state(self) -> OdometryState:
        """Pose and twist by the wheels."""
        return self.odometry.state


def _clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


def _approach(value: float, target: float, step: float) -> float:
    """Return `target`, or the value nearest to it within `step` of `value`."""
    return value + _clip(target - value, step)
