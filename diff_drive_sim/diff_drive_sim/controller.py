# SPDX-License-Identifier: Apache-2.0
"""Velocity commands to wheel speeds: time-out, limits, kinematics, odometry."""

import math
from typing import NamedTuple

from diff_drive_sim.geometry import DiffDriveGeometry
from diff_drive_sim.odometry import OdometryState
from diff_drive_sim.odometry import WheelOdometry
from diff_drive_sim.parameters import DiffDriveParameters

# Longest step believed between two wheel angles [s]: after a gap the robot eases in, not jumps.
MAXIMUM_STEP = 0.1


class Velocity(NamedTuple):
    """Planar velocity of the middle of the axle, which cannot slide sideways."""

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
        self.odometry = WheelOdometry(geometry)
        self.parameters = parameters
        self.refused_commands = 0
        self.reset()

    def reset(self) -> None:
        """Stand still at the origin, with no command."""
        self.odometry.reset()
        self.velocity = Velocity()
        self._wanted = Velocity()
        self._age = math.inf

    @property
    def parameters(self) -> DiffDriveParameters:
        """Limits and time-out; new ones act on the command in force."""
        return self._parameters

    @parameters.setter
    def parameters(self, parameters: DiffDriveParameters) -> None:
        self._parameters = parameters
        fastest = self.geometry.wheel_speeds(
            parameters.linear_velocity, parameters.angular_velocity
        )
        self.odometry.speed_limit = min(max(map(abs, fastest)), self.geometry.speed_limit)

    @property
    def target(self) -> Velocity:
        """
        The command in force: the last one within the limits, or zero when it is too old.

        What is beyond a limit of the robot or of its wheels is slowed down as a whole, so that
        the robot keeps to the curve it was asked to take.
        """
        if self.timed_out:
            return Velocity()
        linear, angular = self._wanted
        limits = self.parameters
        share = min(
            _share(linear, limits.linear_velocity), _share(angular, limits.angular_velocity)
        )
        return self._slowed(Velocity(share * linear, share * angular))

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

        One that is not finite is refused and the previous one stays.
        """
        if not (math.isfinite(linear) and math.isfinite(angular)):
            self.refused_commands += 1
            return False
        self._wanted = Velocity(linear, angular)
        self._age = 0.0
        return True

    def step(self, left: float, right: float, dt: float) -> tuple[float, float]:
        """
        Return left and right wheel speed [rad/s].

        `left`, `right` are the wheel angles now [rad], `dt` [s] after the last ones.
        """
        self.odometry.step(left, right, dt)
        dt = min(dt, MAXIMUM_STEP)
        limits = self.parameters
        target = self.target
        reached = Velocity(
            _approach(self.velocity.linear, target.linear, limits.linear_acceleration * dt),
            _approach(self.velocity.angular, target.angular, limits.angular_acceleration * dt),
        )
        self.velocity = self._slowed(reached)
        self._age += dt
        return self.geometry.wheel_speeds(*self.velocity)

    @property
    def odometry_state(self) -> OdometryState:
        """Pose and twist by the wheels."""
        return self.odometry.state

    def _slowed(self, velocity: Velocity) -> Velocity:
        """Return the velocity, slowed down as a whole to what the faster wheel can do."""
        fastest = max(map(abs, self.geometry.wheel_speeds(*velocity)))
        share = _share(fastest, self.geometry.speed_limit)
        return Velocity(share * velocity.linear, share * velocity.angular)


def _share(value: float, limit: float) -> float:
    """Return the largest factor up to 1 by which a value is within +-limit."""
    return limit / abs(value) if abs(value) > limit else 1.0


def _clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


def _approach(value: float, target: float, step: float) -> float:
    """Return `target`, or the value nearest to it within `step` of `value`."""
    return value + _clip(target - value, step)
