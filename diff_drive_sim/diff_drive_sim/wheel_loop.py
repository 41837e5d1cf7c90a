# SPDX-License-Identifier: Apache-2.0
"""A wheel's motor, its encoder, and the loop that keeps it at its speed."""

from collections import deque
from dataclasses import dataclass
import math
from typing import NamedTuple

from robot_description.robot import Robot

from diff_drive_sim.geometry import DiffDriveGeometry

# A gear motor's stall torque over the torque that its driver lets through.
STALL_SHARE = 3.75
# The simulator integrates motor torques explicitly in steps of 1 ms: a steeper line than what
# stops a wheel in the air within one step would make it ring.
STEEPEST = 1.0 / 0.001


@dataclass(frozen=True)
class WheelMotor:
    """
    A motor at constant voltage: its torque falls linearly with speed, to none at `speed` [rad/s].

    At a duty u in -1..1 it gives `damping (u speed - w)` [N m] at wheel speed w, as far as the
    joint's torque limit lets it. Loaded with the robot it nears its speed with time constant
    `lag` [s].
    """

    speed: float
    damping: float
    lag: float


def wheel_motor(robot: Robot, geometry: DiffDriveGeometry) -> WheelMotor:
    """
    Return the motor that the description's limits, and the robot's mass, make of a wheel.

    Without an effort limit or without masses it has no torque.
    """
    joint = robot.joints[geometry.left_joint]
    radius = geometry.wheel_radius
    wheel_inertia = 0.5 * robot.links[joint.child].mass * radius**2
    inertia = 0.5 * robot.mass * radius**2
    damping = STALL_SHARE * joint.effort / geometry.speed_limit
    if wheel_inertia > 0.0:
        damping = min(damping, STEEPEST * wheel_inertia)
    lag = inertia / damping if damping > 0.0 else math.inf
    return WheelMotor(geometry.speed_limit, damping, lag)


# The firmware's unit of time: its gains are per frame [s].
FRAME = 1.0 / 30.0
# Without ticks for longer than a few frames nobody knows what the wheel has done, or why [s].
LONGEST_SILENCE = 4.0 * FRAME
# The firmware's full duty.
FULL_PWM = 255
# An encoder knows the wheel to one tick: less is no reason to do anything.
DEAD_TICKS = 1.0


class Gains(NamedTuple):
    """Gains by arbotix's names."""

    Kp: float
    Kd: float
    Ki: float
    Ko: float


def is_gap(dt: float) -> bool:
    """Whether ticks came `dt` [s] after the last ones, too late for a loop to compare them."""
    return dt > LONGEST_SILENCE


def count_ticks(angle: float, ticks_per_radian: float) -> int:
    """Return what an encoder shows at a wheel angle [rad]: it counts in the middle of a tick."""
    return math.floor(angle * ticks_per_radian + 0.5)


class WheelLoop:
    """
    Keeps one wheel at its speed by its ticks: the law of arbotix without its rounding.

    arbotix adds (Kp e + Kd (e - e') + Ki sum e) / Ko to the PWM each frame, with e the ticks
    missing in it. Summed up that is a PID on the path: Kp times the ticks that the wheel is
    behind, Kd times those it loses in a frame, Ki times the sum of the first. It trims the PWM
    that the motor needs without load, and compares with where such a motor would be by now, so
    that there is nothing to trim, hence no overshoot, where there is no load. A command may take
    `delay` steps to reach the motor.
    """

    def __init__(
        self, gains: Gains, motor: WheelMotor, ticks_per_radian: float, delay: int = 0
    ) -> None:
        self.gains = gains
        self._delay = delay
        self._motor = motor
        self._scale = ticks_per_radian
        self.reset()

    def reset(self) -> None:
        """Forget the past: the wheel stands where it is."""
        self.duty = 0.0
        self._ticks: int | None = None
        # Commanded: on the way, and in force; and what the motor has reached of that [rad/s].
        self._pending = deque([0.0] * self._delay)
        self._speed = 0.0
        self._expected = 0.0
        self._behind = 0.0  # [ticks]
        self._lost = 0.0  # [ticks in a frame]
        self._sum = 0.0

    def step(self, speed: float, ticks: int, dt: float) -> float:
        """Return the duty, -1 to 1, for a wheel speed [rad/s]; ticks are `dt` [s] after others."""
        if self._ticks is None:
            self._ticks = ticks
        if dt > 0.0:
            self._compare(ticks - self._ticks, dt)
            self._ticks = ticks
        self._pending.append(speed)
        self._speed = self._pending.popleft()
        gains = self.gains
        trim = gains.Kp * _beyond(self._behind) + gains.Kd * self._lost + gains.Ki * self._sum
        duty = speed / self._motor.speed + trim / gains.Ko / FULL_PWM
        self.duty = max(-1.0, min(1.0, duty))
        return self.duty

    def _compare(self, counted: int, dt: float) -> None:
        """Take in the ticks of the time since the last step [s]."""
        lag = self._motor.lag
        decay = math.exp(-dt / lag)
        missing = self._expected - self._speed
        expected = (self._speed * dt + missing * lag * (1.0 - decay)) * self._scale
        self._expected = self._speed + missing * decay
        behind = expected - counted
        self._lost += (behind * FRAME / dt - self._lost) * (1.0 - math.exp(-dt / FRAME))
        # A motor at its limit cannot do more: what it misses there is not to be caught up.
        if abs(self.duty) < 1.0 or behind * self.duty < 0.0:
            self._behind += behind
            self._sum += _beyond(self._behind) * dt / FRAME


def _beyond(ticks: float) -> float:
    """Return by how much a number of ticks is out of the dead zone."""
    return ticks - max(-DEAD_TICKS, min(DEAD_TICKS, ticks))
