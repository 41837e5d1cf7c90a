# SPDX-License-Identifier: Apache-2.0
"""A robot of arithmetic: its wheels do what they are told, and it goes where they roll."""

from diff_drive_sim.geometry import DiffDriveGeometry
from diff_drive_sim.odometry import OdometryState
from diff_drive_sim.odometry import WheelOdometry


class KinematicBase:
    """
    Two wheels without slip, motors or mass: what mode fake drives.

    Keeps the wheels' angles and the true pose; `step` turns the wheels at speeds [rad/s] for a
    time [s].
    """

    def __init__(self, geometry: DiffDriveGeometry) -> None:
        self._rolling = WheelOdometry(geometry)
        self.reset()

    def reset(self) -> None:
        """Be at the origin, the wheels at angle 0."""
        self._rolling.reset()
        self.angles = (0.0, 0.0)
        self.speeds = (0.0, 0.0)
        self._rolling.step(*self.angles, 0.0)

    @property
    def pose(self) -> OdometryState:
        """Where it is, and its velocity."""
        return self._rolling.state

    def step(self, left: float, right: float, dt: float) -> None:
        """Turn the wheels at speeds [rad/s] for `dt` [s]."""
        self.speeds = (left, right)
        self.angles = (self.angles[0] + left * dt, self.angles[1] + right * dt)
        self._rolling.step(*self.angles, dt)
