# SPDX-License-Identifier: Apache-2.0
"""Odometry of the last seconds, to look up where the robot was when a scan was taken."""

from collections import deque
import math
from typing import NamedTuple

import numpy as np
from wasd_core.rotations import Pose

from wasd_navigation.se2 import wrap

# So many are remembered: two seconds at 50 Hz.
REMEMBERED = 100


class Odometry(NamedTuple):
    """
    The base in the odom frame as seen from above.

    `pose` is T_odom_base, shape (3,) [m, m, rad], `velocity` (vx, vy, wz) is in the base frame,
    `covariance`, shape (3, 3), is the pose's. `level` is the base in the level frame below it,
    whose origin is at the height of the odom frame's and whose x is ahead.
    """

    pose: np.ndarray
    velocity: np.ndarray
    covariance: np.ndarray
    level: Pose


class OdometryMemory:
    """Odometry by its stamps [s]."""

    def __init__(self) -> None:
        self._known: deque[tuple[float, Odometry]] = deque(maxlen=REMEMBERED)

    def add(self, stamp: float, odometry: Odometry) -> None:
        """Remember odometry; when time jumps back, nothing else."""
        if self._known and stamp < self._known[-1][0]:
            self._known.clear()
        self._known.append((stamp, odometry))

    def at(self, stamp: float) -> Odometry | None:
        """Return odometry of an instant, between two; None where that is not known, or not yet."""
        if not self._known or not self._known[0][0] <= stamp <= self._known[-1][0]:
            return None
        after = next(index for index, (time, _) in enumerate(self._known) if time >= stamp)
        (end, late), (begin, early) = self._known[after], self._known[max(after - 1, 0)]
        if end <= begin:
            return late
        turn = wrap(late.pose[2] - early.pose[2])
        step = np.array([*(late.pose[:2] - early.pose[:2]), turn])
        pose = early.pose + (stamp - begin) / (end - begin) * step
        return late._replace(pose=np.array([pose[0], pose[1], wrap(pose[2])]))

    def age(self, stamp: float) -> float:
        """Return how long before the newest odometry an instant was [s]; NaN: there is none."""
        return self._known[-1][0] - stamp if self._known else math.nan

    def clear(self) -> None:
        """Forget everything."""
        self._known.clear()
