# SPDX-License-Identifier: Apache-2.0
"""Encoder ticks, and the loop that keeps a wheel at its speed by them."""

from collections import deque
import math
from typing import NamedTuple

from diff_drive_sim.wheel_motor import WheelMotor

# The firmware's unit of time: its gains are per frame [s].
FRAME = 1.0 / 30.0
# Without ticks for longer than a few frames nobody knows what the wheel has done, or why [s].
LONGEST_SILENCE = 4.0 * FRAME
# The firmware's full duty.
FULL_PWM = 255.0
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
