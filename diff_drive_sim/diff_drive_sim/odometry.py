# SPDX-License-Identifier: Apache-2.0
"""Where the robot is, from how far its wheels have turned."""

import math
from typing import NamedTuple

from diff_drive_sim.geometry import DiffDriveGeometry


class OdometryState(NamedTuple):
    """Pose in the odom frame [m], [rad], twist in the base frame [m/s], [rad/s]."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    linear: float = 0.0
    angular: float = 0.0


class WheelOdometry:
    """
    Integrates wheel angles along exact arcs.

    Keeps the pose and the last wheel angles; the first `step` only takes the angles in, so that
    encoders that do not start at 0 move nothing.
    """

    def __init__(self, geometry: DiffDriveGeometry) -> None:
        self._geometry = geometry
        self.reset()

    def reset(self) -> None:
        """Put the robot at the origin of the odom frame."""
        self.state = OdometryState()
        self._angles: tuple[float, float] | None = None
        self._elapsed = 0.0  # [s] since those angles

    def step(self, left: float, right: float, dt: float) -> OdometryState:
        """
        Take in wheel angles [rad] `dt` [s] after the last ones; angles not finite change nothing.

        The midpoint moves on a circle of radius forward / turn: its chord is
        forward sin(turn/2) / (turn/2) along the mean heading, which is exact for constant speeds.
        """
        self._elapsed += dt
        if not (math.isfinite(left) and math.isfinite(right)):
            return self.state
        if self._angles is not None:
            forward, turn = self._geometry.displacement(
                left - self._angles[0], right - self._angles[1]
            )
            elapsed = self._elapsed
            heading = self.state.yaw + 0.5 * turn
            chord = forward * _sinc(0.5 * turn)
            self.state = OdometryState(
                x=self.state.x + chord * math.cos(heading),
                y=self.state.y + chord * math.sin(heading),
                yaw=self.state.yaw + turn,
                linear=forward / elapsed if elapsed > 0.0 else self.state.linear,
                angular=turn / elapsed if elapsed > 0.0 else self.state.angular,
            )
        self._angles = (left, right)
        self._elapsed = 0.0
        return self.state


def _sinc(angle: float) -> float:
    """Return sin(angle) / angle; its series where the quotient would lose digits."""
    if abs(angle) < 1e-4:
        return 1.0 - angle * angle / 6.0
    return math.sin(angle) / angle
