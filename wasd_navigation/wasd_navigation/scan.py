# SPDX-License-Identifier: Apache-2.0
"""What a planar lidar saw in one instant, as points in the robot's base frame."""

from dataclasses import dataclass

import numpy as np

from wasd_navigation.se2 import transform


@dataclass(frozen=True)
class Scan:
    """
    Rays of one instant in the base frame (x ahead, y left) [m].

    `origin`, shape (2,), is where they begin; `ends`, shape (n, 2), are where they end: at what
    they hit where `hits`, shape (n,), is true, else at the lidar's range, with nothing before it.
    """

    origin: np.ndarray
    ends: np.ndarray
    hits: np.ndarray

    @property
    def points(self) -> np.ndarray:
        """What was hit, shape (m, 2) [m]."""
        points: np.ndarray = self.ends[self.hits]
        return points


def read_scan(
    ranges: np.ndarray, angles: np.ndarray, limits: tuple[float, float], mount: np.ndarray
) -> Scan:
    """
    Return the rays that a sensor_msgs/LaserScan tells of (REP 117).

    `ranges` [m] and `angles` [rad], shape (n,); `limits` are the least and the greatest range
    [m]; `mount` is the lidar's pose in the base frame, shape (3,). Infinite ranges are rays that
    hit nothing up to the greatest range; those below the least, and NaN, tell nothing.
    """
    least, most = limits
    tells = ranges >= least
    ranges, angles = ranges[tells], angles[tells]
    hits = ranges <= most
    lengths = np.where(hits, ranges, most)
    ends = np.stack((lengths * np.cos(angles), lengths * np.sin(angles)), axis=1)
    return Scan(mount[:2].copy(), transform(mount, ends), hits)
