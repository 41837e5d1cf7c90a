# SPDX-License-Identifier: Apache-2.0
"""A room with a box in it, seen by a planar lidar, for tests of mapping and localising."""

import math

import numpy as np
from wasd_navigation.records import Scan

# Least x, y, greatest x, y [m]: the room seen from inside, a box from outside.
ROOM, BOX = (-2.5, -2.0, 3.0, 2.5), (1.2, 0.9, 1.9, 1.7)
RAYS = np.linspace(-3.0, 3.0, 360)


def look(pose: np.ndarray, random: np.random.Generator, with_box: bool = True) -> Scan:
    """Return what a lidar with a noise of 1 cm sees from a pose."""
    directions = np.stack((np.cos(RAYS + pose[2]), np.sin(RAYS + pose[2])))
    low = (np.array(ROOM[:2]) - pose[:2])[:, None] / directions
    high = (np.array(ROOM[2:]) - pose[:2])[:, None] / directions
    ranges = np.maximum(low, high).min(axis=0)
    if with_box:
        low = (np.array(BOX[:2]) - pose[:2])[:, None] / directions
        high = (np.array(BOX[2:]) - pose[:2])[:, None] / directions
        near, far = np.minimum(low, high).max(axis=0), np.maximum(low, high).min(axis=0)
        ranges = np.where((near < far) & (near > 0.0), np.minimum(near, ranges), ranges)
    ranges = ranges + 0.01 * random.normal(size=len(RAYS))
    ends = np.stack((ranges * np.cos(RAYS), ranges * np.sin(RAYS)), axis=1)
    return Scan(np.zeros(2), ends, np.ones(len(RAYS), dtype=np.bool_))


def circle(count: int) -> np.ndarray:
    """Return poses on a circle that begins at the origin along x, shape (count, 3)."""
    turns = np.linspace(0.0, 4.0 * math.pi, count)
    return np.stack((np.sin(turns), 1.0 - np.cos(turns), turns), axis=1) * (0.6, 0.6, 1.0)
