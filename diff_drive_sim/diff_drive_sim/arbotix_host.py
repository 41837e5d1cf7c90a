# SPDX-License-Identifier: Apache-2.0
"""arbotix_driver's diff_controller as it was: ramp, time-out and odometry with their slips."""

import math

from diff_drive_sim.arbotix_firmware import FRAMES_PER_SECOND

# The driver's main loop looks at the controller this often [ns].
LOOP = 10_000_000
# What arbotix takes when accel_limit is not given [m/s^2].
DEFAULT_ACCEL_LIMIT = 0.1


class ArbotixHost:
    """
    Takes velocities, gives set-points [ticks per 1/30 s], and makes odometry from encoders.

    Known slips, kept: the ramp adds ticks per second to ticks per 1/30 s, so it is 30 times as
    steep as accel_limit says, and ramps each wheel by itself; odometry lays a path along the
    heading before it minus the turn, where plus half of it would be right; the next update is
    due one period after the last one that came late.
    """

    def __init__(
        self,
        ticks_meter: float,
        base_width: float,
        rate: float = 10.0,
        timeout: float = 1.0,
        accel_limit: float = DEFAULT_ACCEL_LIMIT,
    ) -> None:
        self._ticks_meter = ticks_meter
        self._base_width = base_width
        self._rate = rate
        self._period = round(1e9 / rate)
        self.configure(timeout, accel_limit)
        self.reset(0)

    def configure(self, timeout: float, accel_limit: float) -> None:
        """Go on with another time-out [s] and ramp [m/s^2, as it were]."""
        self._timeout = round(1e9 * timeout)
        self._step = int(accel_limit * self._ticks_meter / self._rate)

    def reset(self, now: int) -> None:
        """Begin at a time [ns], at rest."""
        self.setpoints = (0, 0)
        self.x = self.y = self.yaw = 0.0
        self.linear = self.angular = 0.0
        self._wanted = (0, 0)
        self._commanded_at = self._updated_at = now
        self._next = now + self._period
        self._ticks: tuple[int, int] | None = None

    def command(self, linear: float, angular: float, now: int) -> None:
        """Take a velocity [m/s], [rad/s] at a time [ns]."""
        self._commanded_at = now
        self._wanted = setpoints_of(linear, angular, self._base_width, self._ticks_meter)

    @property
    def timed_out(self) -> bool:
        """Whether the last update found no command young enough."""
        return self._updated_at > self._commanded_at + self._timeout

    def update(self, now: int, left: int, right: int) -> bool:
        """Do what is due at a time [ns] with encoders at these ticks; return whether it was."""
        if now <= self._next:
            return False
        elapsed, self._updated_at = 1e-9 * (now - self._updated_at), now
        self._count(left, right, elapsed)
        if self.timed_out:
            self._wanted = (0, 0)
        self.setpoints = (
            self._ramp(self.setpoints[0], self._wanted[0]),
            self._ramp(self.setpoints[1], self._wanted[1]),
        )
        self._next = now + self._period
        return True

    def _count(self, left: int, right: int, elapsed: float) -> None:
        before, self._ticks = self._ticks or (left, right), (left, right)
        paths = [(b - a) / self._ticks_meter for a, b in zip(before, self._ticks, strict=True)]
        path = (paths[0] + paths[1]) / 2
        turn = (paths[1] - paths[0]) / self._base_width
        self.linear, self.angular = path / elapsed, turn / elapsed
        ahead, aside = math.cos(turn) * path, -math.sin(turn) * path
        self.x += math.cos(self.yaw) * ahead - math.sin(self.yaw) * aside
        self.y += math.sin(self.yaw) * ahead + math.cos(self.yaw) * aside
        self.yaw += turn

    def _ramp(self, setpoint: int, wanted: int) -> int:
        if setpoint < wanted:
            return min(setpoint + self._step, wanted)
        return max(setpoint - self._step, wanted)


def setpoints_of(
    linear: float, angular: float, base_width: float, ticks_meter: float
) -> tuple[int, int]:
    """Return what arbotix makes of a velocity [m/s], [rad/s]: whole ticks per 1/30 s."""
    left = (linear - angular * base_width / 2.0) * ticks_meter / FRAMES_PER_SECOND
    right = (linear + angular * base_width / 2.0) * ticks_meter / FRAMES_PER_SECOND
    return int(left), int(right)
