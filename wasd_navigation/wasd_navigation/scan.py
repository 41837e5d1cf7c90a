# SPDX-License-Identifier: Apache-2.0
"""What a planar lidar saw in one instant, as points in the robot's base frame."""

from dataclasses import dataclass

import numpy as np
from wasd_core.rotations import Pose
from wasd_core.rotations import yaw_matrix

# What a tilted lidar sees below this height is the floor [m]; nor is anything that ends less far
# below the lidar.
FLOOR, LEAST_DESCENT = 0.05, 0.02
# What is farther is not seen, whatever a lidar says of itself; and so far a ray is free at most
# that hits nothing [m].
HORIZON, FREE_SIGHT = 100.0, 30.0


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
    [m]; `mount` is the lidar's pose in the base frame, shape (3,). Ranges beyond the greatest are
    of rays that hit nothing up to there, or up to FREE_SIGHT; those below the least, and NaN, tell
    nothing.
    """
    x, y, yaw = mount.tolist()
    level = Pose(np.array([x, y, 1.0]), yaw_matrix(yaw))
    return read_tilted_scan(ranges, angles, limits, level)


def read_tilted_scan(
    ranges: np.ndarray, angles: np.ndarray, limits: tuple[float, float], mount: Pose
) -> Scan:
    """
    Return the rays of a lidar that tilts, as seen from above; see `read_scan`.

    `mount` is the lidar's pose in a level frame below the base: its origin is at the height of
    the floor, x is ahead. Rays that end on the floor tell nothing.
    """
    least, most = limits
    tells = ranges >= least
    ranges, angles = ranges[tells], angles[tells]
    along = np.stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)), axis=1)
    along = along @ mount.rotation.T
    hits = ranges <= min(most, HORIZON)
    lengths = np.where(hits, ranges, min(most, FREE_SIGHT))
    is_floor = -lengths * along[:, 2] >= max(mount.position[2] - FLOOR, LEAST_DESCENT)
    ends = mount.position[:2] + lengths[:, None] * along[:, :2]
    return Scan(mount.position[:2].copy(), ends[~is_floor], hits[~is_floor])
