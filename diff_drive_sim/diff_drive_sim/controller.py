# SPDX-License-Identifier: Apache-2.0
"""Velocity commands to wheel speeds: age, time-out, limits, kinematics, odometry."""

from collections.abc import Callable
import math
from typing import NamedTuple

from robot_description.morphology.equip_wheels import Strength
from wasd_core.timing import Watchdog

from diff_drive_sim.limits import PlanarRamp
from diff_drive_sim.odometry import (
    DiffDriveGeometry,
    Growth,
    OdometryState,
    PlanarCovariance,
    WheelOdometry,
)
from diff_drive_sim.parameters import DiffDriveParameters

# A clock that is ahead by less than this [s] is no news.
AHEAD = 0.1


class StampVerdict(NamedTuple):
    """The age of a command [s], None for one to be dropped, and what is odd about it."""

    age: float | None
    note: str = ''


def judge_stamp(stamp: float, now: float, timeout: float) -> StampVerdict:
    """
    Judge a stamp [s] at a time [s].

    A stamp of zero is none: the command is of now. One older than the time-out is dropped, and
    where there is a time-out a younger one has used up some of it. One from the future is of now,
    too: a sender whose clock is ahead must not outlive the time-out.
    """
    if stamp == 0.0:
        return StampVerdict(0.0, 'has no stamp: taken as of now')
    age = now - stamp
    if age < 0.0:
        note = f'is stamped {-age:.3f} s ahead of this clock: taken as of now'
        return StampVerdict(0.0, note if -age > AHEAD else '')
    if age > timeout > 0.0:
        note = f'is {age:.3f} s old, more than cmd_vel_timeout {timeout:g} s: dropped'
        return StampVerdict(None, note)
    return StampVerdict(age)


# A ramp goes on for no longer than this after a gap [s]: the robot eases in, not jumps. Nothing
# else is cut short: a command has the age that it has.
MAXIMUM_STEP = 0.1


class Velocity(NamedTuple):
    """Planar velocity of the middle of the axle, which cannot slide sideways."""

    linear: float = 0.0  # [m/s], forward
    angular: float = 0.0  # [rad/s], counter-clockwise


class DiffDriveController:
    """
    Follows the last velocity command with bounded velocity, acceleration and jerk.

    Keeps the command and its age, the velocity reached so far and the odometry. One `step` is
    one control period: wheel angles in, wheel speeds out. `lowered` is the last command that was
    too fast for a wheel, and what it became.
    """

    def __init__(
        self,
        geometry: DiffDriveGeometry,
        parameters: DiffDriveParameters,
        strength: tuple[Strength, Strength] = (Strength(), Strength()),
    ) -> None:
        """Take wheels and parameters; `strength` is what motors can do, ahead and in a turn."""
        self.geometry = geometry
        self._strength = strength
        self.odometry = WheelOdometry(geometry, window=parameters.velocity_rolling_window_size)
        self._ramp = PlanarRamp(geometry)
        self._command_age = Watchdog(parameters.cmd_vel_timeout)
        self.parameters = parameters
        # What a guard leaves of the command in force.
        self.hold_back: Callable[[Velocity], Velocity] = lambda velocity: velocity
        self.refused_commands = 0
        self.lowered: tuple[Velocity, Velocity] | None = None
        self.reset()

    def reset(self) -> None:
        """Stand still at the origin, with no command."""
        self.odometry.reset()
        self.velocity = Velocity()
        self._ramp.reset()
        self._wanted = Velocity()
        self.forget_command()

    def forget_command(self) -> None:
        """Be as if no command had ever come: the robot stops on its ramp."""
        self._command_age.reset()
        self._is_new = False

    def reset_odometry(self) -> None:
        """Be at the origin, the robot going on as it does."""
        self.odometry.set_pose(0.0, 0.0, 0.0, PlanarCovariance())

    def set_odometry(self, x: float, y: float, yaw: float, covariance: PlanarCovariance) -> None:
        """Be at a pose [m], [rad], the robot going on as it does."""
        self.odometry.set_pose(x, y, yaw, covariance)

    @property
    def parameters(self) -> DiffDriveParameters:
        """Limits and time-out; new ones act on the command in force."""
        return self._parameters

    @parameters.setter
    def parameters(self, parameters: DiffDriveParameters) -> None:
        self._parameters = parameters
        linear = parameters.linear_limits().within(self._strength[0])
        angular = parameters.angular_limits(self.geometry.wheel_separation)
        angular = angular.within(self._strength[1])
        self._ramp.linear.limits, self._ramp.angular.limits = linear, angular
        self._command_age.timeout = parameters.cmd_vel_timeout
        self.odometry.growth = Growth(
            parameters.distance_variance, parameters.turn_variance, parameters.drift_variance
        )
        geometry = self.geometry
        rim = max(linear.forward, linear.backward)
        rim += 0.5 * geometry.wheel_separation * max(angular.forward, angular.backward)
        smallest = min(geometry.left_radius, geometry.right_radius)
        self.odometry.speed_limit = min(rim / smallest, geometry.speed_limit)

    @property
    def target(self) -> Velocity:
        """
        The command in force: the last one within the limits, or zero when it is too old.

        What is beyond a limit of the robot or of its wheels is slowed down as a whole, so that
        the robot keeps to the curve it was asked to take.
        """
        return self._slow_down(self._limited())

    def _limited(self) -> Velocity:
        """Return the command in force within the limits of the axes."""
        if self.timed_out:
            return Velocity()
        linear, angular = self._wanted
        limits = self._ramp.linear.limits, self._ramp.angular.limits
        share = min(limits[0].share(linear), limits[1].share(angular))
        return Velocity(share * linear, share * angular)

    @property
    def timed_out(self) -> bool:
        """Whether there has been no command for longer than the time-out."""
        return not self._command_age.is_alive

    @property
    def state(self) -> str:
        """`driving`, `stopped`, or `timed out` when it stops because commands have ceased."""
        if self.velocity == Velocity() and self.target == Velocity():
            return 'stopped'
        return 'timed out' if self.timed_out else 'driving'

    def command(self, linear: float, angular: float, age: float = 0.0) -> bool:
        """
        Take a velocity command [m/s], [rad/s] of an age [s] and return whether it was taken.

        It is in force from the next step on, which may make it older. One that is not finite is
        refused and the previous one stays.
        """
        if not (math.isfinite(linear) and math.isfinite(angular)):
            self.refused_commands += 1
            return False
        self._wanted = Velocity(linear, angular)
        self._command_age.hear(age)
        self._is_new = True
        return True

    def step(self, left: float, right: float, dt: float, late: float = 0.0) -> tuple[float, float]:
        """
        Return left and right wheel speed [rad/s].

        `left`, `right` are the wheel angles now [rad], `dt` [s] after the last ones; a command
        that has come since those came `late` [s] before these.
        """
        if self.parameters.open_loop:
            self.odometry.advance(*self.velocity, dt)
        else:
            self.odometry.step(left, right, dt)
        self._command_age.step(late if self._is_new else dt)
        self._is_new = False
        limited = self._limited()
        target = self._slow_down(limited)
        if target != limited:
            self.lowered = limited, target
        target = self.hold_back(target)
        self.velocity = Velocity(*self._ramp.step(*target, self._ramp_time(dt)))
        return self.geometry.wheel_speeds(*self.velocity)

    def _ramp_time(self, dt: float) -> float:
        """Return for how long the ramp goes on [s]: a stop that was due in a gap is over."""
        if not self.timed_out:
            return min(dt, MAXIMUM_STEP)
        return min(dt, max(MAXIMUM_STEP, self._command_age.age - self._command_age.timeout))

    @property
    def odometry_state(self) -> OdometryState:
        """Pose and twist by the wheels."""
        return self.odometry.state

    @property
    def covariance(self) -> PlanarCovariance:
        """How sure the pose is."""
        return self.odometry.covariance

    @property
    def restarts(self) -> int:
        """How often the wheel angles have jumped."""
        return self.odometry.restarts

    def _slow_down(self, velocity: Velocity) -> Velocity:
        """Return the velocity, slowed down as a whole to what the faster wheel can do."""
        fastest = max(map(abs, self.geometry.wheel_speeds(*velocity)))
        limit = self.geometry.speed_limit
        share = limit / fastest if fastest > limit else 1.0
        return Velocity(share * velocity.linear, share * velocity.angular)
