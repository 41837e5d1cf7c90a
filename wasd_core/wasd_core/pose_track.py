# SPDX-License-Identifier: Apache-2.0
"""The recent poses of a base, for measurements at different times."""

from collections import deque

import numpy as np

from wasd_core.rotations import Pose


class PoseTrack:
    """Poses of a base over time, of which those of the last `seconds` are kept."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        # Times, positions, quaternions.
        self._poses: deque[tuple[float, np.ndarray, np.ndarray]] = deque()

    @property
    def last(self) -> tuple[np.ndarray, np.ndarray] | None:
        """The latest position and quaternion; None where there is no pose."""
        return self._poses[-1][1:] if self._poses else None

    def add(self, time: float, position: np.ndarray, orientation: np.ndarray) -> None:
        """Add a pose: time [s], position (3,) [m], quaternion (4,) w, x, y, z."""
        if self._poses and time <= self._poses[-1][0]:
            self._poses.clear()  # time began again
        self._poses.append((time, position.copy(), orientation.copy()))
        while time - self._poses[0][0] > self._seconds:
            self._poses.popleft()

    def place(self, points: np.ndarray, times: np.ndarray, mount: Pose) -> np.ndarray | None:
        """
        Return points (n, 3) [m] of a sensor in the frame in which the poses are.

        Each was seen at its own time [s], (n,), by a sensor that is mounted so in the base.
        Between two poses the base moves evenly; before the first and after the last it stands
        still. None where there is no pose.
        """
        if not self._poses:
            return None
        when, positions, quaternions = map(np.array, zip(*self._poses, strict=True))
        # A quaternion and its negative are one rotation: each is to be near the one before.
        flips = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0
        quaternions[1:][np.cumsum(flips) % 2 == 1] *= -1.0
        columns = np.column_stack((positions, quaternions)).T
        pose = np.stack([np.interp(times, when, column) for column in columns])
        w, x, y, z = pose[3:] / np.linalg.norm(pose[3:], axis=0)
        in_base = points @ mount.rotation.T + mount.position
        axis = np.stack((x, y, z), axis=1)
        # v + 2 q x (q x v + w v), the rotation of v by a unit quaternion.
        twice = 2.0 * np.cross(axis, in_base)
        turned = in_base + w[:, None] * twice + np.cross(axis, twice)
        return np.asarray(pose[:3].T + turned)
