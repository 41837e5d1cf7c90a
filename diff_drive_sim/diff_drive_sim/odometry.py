# SPDX-License-Identifier: Apache-2.0
"""Where the robot is, from how far its wheels have turned."""

import math
from typing import NamedTuple

from diff_drive_sim.geometry import DiffDriveGeometry

# Wheels are believed to turn at most so many times as fast as they can be commanded to: one that
# is pushed or slips is faster than that, one whose encoder has restarted much faster.
BELIEVABLE = 4.0
# A change of angle that is always believed [rad], however little time has passed.
SMALLEST_JUMP = 0.05


class OdometryState(NamedTuple):
    """Pose of the robot's base in the odom frame [m], [rad], its twist in the base frame."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    linear: float = 0.0  # [m/s], forward
    angular: float = 0.0  # [rad/s]
    lateral: float = 0.0  # [m/s], to the left: of a base that is not on the axle


class WheelOdometry:
    """
    Integrates wheel angles along exact arcs.

    Keeps the pose and the last wheel angles; the first `step` only takes the angles in, so that
    encoders that do not start at 0 move nothing. Nor does a change that no wheel can make at
    `speed_limit` [rad/s], the largest speed it is commanded to: encoders that have restarted,
    e.g. because the simulator in another process was reset. `restarts` counts them.
    """

    def __init__(self, geometry: DiffDriveGeometry, speed_limit: float = math.inf) -> None:
        self._geometry = geometry
        self.speed_limit = speed_limit
        self.restarts = 0
        self.reset()

    def reset(self) -> None:
        """Put the robot at the origin of the odom frame."""
        self.state = OdometryState()
        self._angles: tuple[float, float] | None = None
        self._elapsed = 0.0  # [s] since those angles

    def step(self, left: float, right: float, dt: float) -> OdometryState:
        """
        Take in wheel angles [rad] `dt` [s] after the last ones; angles not finite change nothing.

        The axle's middle moves on a circle of radius forward / turn: its chord is
        forward sin(turn/2) / (turn/2) along the mean heading, which is exact for constant speeds.
        The base is rigidly behind it.
        """
        self._elapsed += dt
        if not (math.isfinite(left) and math.isfinite(right)):
            return self.state
        if self._angles is not None:
            changes = left - self._angles[0], right - self._angles[1]
            if self._can_be(changes):
                self._move(*self._geometry.displacement(*changes))
            else:
                self.restarts += 1
                self.state = self.state._replace(linear=0.0, angular=0.0, lateral=0.0)
        self._angles = (left, right)
        self._elapsed = 0.0
        return self.state

    def _can_be(self, changes: tuple[float, float]) -> bool:
        if math.isinf(self.speed_limit):
            return True
        largest = max(SMALLEST_JUMP, BELIEVABLE * self.speed_limit * self._elapsed)
        return max(map(abs, changes)) <= largest

    def _move(self, forward: float, turn: float) -> None:
        """Move the axle's middle along an arc [m], [rad], and the base with it."""
        before, elapsed = self.state, self._elapsed
        offset_x, offset_y = self._geometry.axle_x, self._geometry.axle_y
        heading = before.yaw + 0.5 * turn
        yaw = before.yaw + turn
        chord = forward * _sinc(0.5 * turn)
        # p_base = p_axle - R(yaw) offset, hence what R changes moves the base, too.
        cos = math.cos(before.yaw) - math.cos(yaw)
        sin = math.sin(before.yaw) - math.sin(yaw)
        linear, angular = before.linear, before.angular
        if elapsed > 0.0:
            angular = turn / elapsed
            linear = forward / elapsed + angular * offset_y
        self.state = OdometryState(
            x=before.x + chord * math.cos(heading) + cos * offset_x - sin * offset_y,
            y=before.y + chord * math.sin(heading) + sin * offset_x + cos * offset_y,
            yaw=yaw,
            linear=linear,
            angular=angular,
            lateral=-angular * offset_x,
        )


def _sinc(angle: float) -> float:
    """Return sin(angle) / angle; its series where the quotient would lose digits."""
    if abs(angle) < 1e-4:
        return 1.0 - angle * angle / 6.0
    return math.sin(angle) / angle
