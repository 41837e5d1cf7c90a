# SPDX-License-Identifier: Apache-2.0
"""A wheel's motor, its encoder, and the loop that keeps it at its speed."""

from collections import deque
from dataclasses import dataclass
import math
from typing import NamedTuple

from robot_description.morphology.equip_wheels import size_motor
from robot_description.morphology.wheels import Drive
from robot_description.robot import Robot

from diff_drive_sim.odometry import Pair


@dataclass(frozen=True)
class WheelMotor:
    """
    A motor at constant voltage: its torque falls linearly with speed, to none at `speed` [rad/s].

    At a duty u in -1..1 it gives `damping (u speed - w)` [N m] at wheel speed w, as far as the
    joint's torque limit, `effort` [N m], lets it. Loaded with the robot it nears its speed with
    time constant `lag` [s]. The joint itself takes `drag w` and, dry, `friction` [N m].
    """

    speed: float
    damping: float
    lag: float
    drag: float = 0.0
    friction: float = 0.0
    effort: float = 0.0

    @property
    def top_speed(self) -> float:
        """What full duty, and the torque limit, keep up against the joint's drag [rad/s]."""
        if self.drag == 0.0 or self.damping == 0.0:
            return self.speed
        against_drag = max(0.0, self.effort - self.friction) / self.drag
        return min(self.speed * self.damping / (self.damping + self.drag), against_drag)

    def duty(self, speed: float) -> float:
        """Return the duty that keeps a wheel at a speed [rad/s] where nothing loads it."""
        if self.damping == 0.0 or speed == 0.0:
            return speed / self.speed
        dry = math.copysign(self.friction / self.damping, speed)
        return speed / self.speed * (1.0 + self.drag / self.damping) + dry / self.speed


def wheel_motor(robot: Robot, drive: Drive) -> WheelMotor:
    """
    Return the motor that the description's limits, and what it moves, make of a wheel.

    Without an effort limit or without masses it has no torque.
    """
    size = size_motor(robot, drive)
    joint = drive.weakest.joint
    resisting = size.damping + joint.damping
    lag = size.straight / resisting if size.damping > 0.0 else math.inf
    return WheelMotor(
        drive.speed_limit, size.damping, lag, joint.damping, joint.friction, joint.effort
    )


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
        duty = self._motor.duty(speed) + trim / gains.Ko / FULL_PWM
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


class FloatDrive:
    """Two wheel loops with fractions."""

    def __init__(self, gains: Gains, motor: WheelMotor, scale: float, delay: int) -> None:
        self._loops = (
            WheelLoop(gains, motor, scale, delay),
            WheelLoop(gains, motor, scale, delay),
        )

    def step(self, speeds: Pair, ticks: tuple[int, int], dt: float) -> Pair:
        """Return duties, -1 to 1, for forward wheel speeds [rad/s]; `dt` [s] after the last."""
        left, right = self._loops
        return left.step(speeds[0], ticks[0], dt), right.step(speeds[1], ticks[1], dt)

    def set_gains(self, gains: Gains) -> None:
        """Go on with other gains."""
        for loop in self._loops:
            loop.gains = gains

    def reset(self) -> None:
        """Forget the past."""
        for loop in self._loops:
            loop.reset()


def _beyond(ticks: float) -> float:
    """Return by how much a number of ticks is out of the dead zone."""
    return ticks - max(-DEAD_TICKS, min(DEAD_TICKS, ticks))
