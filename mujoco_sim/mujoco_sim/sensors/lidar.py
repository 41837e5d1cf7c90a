# SPDX-License-Identifier: Apache-2.0
"""A planar lidar: rays from one point against everything that collides."""

import mujoco
import numpy as np
from robot_description.mujoco.geoms import VISUAL_GROUP
from robot_description.robot import Robot

from mujoco_sim.sensors.mount import find_mount
from mujoco_sim.sensors.mount import Snapshot
from mujoco_sim.sensors.tags import LidarTag
from mujoco_sim.world import World

# What is there to be looked at only is not there for a lidar: it sees the same without a viewer.
SEEN_GROUPS = np.array([group != VISUAL_GROUP for group in range(mujoco.mjNGROUP)], dtype=np.uint8)


class Lidar:
    """Measures ranges; the body that carries it is transparent to its rays."""

    def __init__(self, tag: LidarTag, world: World, robot: Robot, snapshot: Snapshot) -> None:
        self.tag = tag
        self._model = world.model
        self._snapshot = snapshot
        self._mount = find_mount(world, robot, tag.link, tag.pose)
        angles = np.linspace(tag.min_angle, tag.max_angle, tag.samples)
        self._directions = np.stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)))
        self._hits = np.empty(tag.samples, dtype=np.int32)
        self._distances = np.empty(tag.samples)

    @property
    def angle_increment(self) -> float:
        """Angle from one ray to the next [rad]."""
        return (self.tag.max_angle - self.tag.min_angle) / max(1, self.tag.samples - 1)

    def true_ranges(self) -> np.ndarray:
        """Return the distance along each ray [m], shape (samples,); infinite where nothing is."""
        data = self._snapshot.take()
        sensor = self._mount.in_world(data)
        mujoco.mj_multiRay(
            self._model,
            data,
            sensor.position,
            (sensor.rotation @ self._directions).T.flatten(),
            SEEN_GROUPS,
            True,
            self._mount.body,
            self._hits,
            self._distances,
            None,
            self.tag.samples,
            self.tag.max_range + 6.0 * self.tag.noise,
        )
        return np.where(self._hits >= 0, self._distances, np.inf)

    def scan(self, random: np.random.Generator | None) -> np.ndarray:
        """
        Return measured ranges [m], shape (samples,), by REP 117.

        With a `random` generator they are noisy; they are rounded to the resolution. What is
        beyond the maximum is +inf, what is below the minimum -inf.
        """
        tag = self.tag
        ranges = self.true_ranges()
        if random is not None:
            ranges = ranges + tag.noise * random.normal(size=tag.samples)
        if tag.resolution > 0.0:
            ranges = np.round(ranges / tag.resolution) * tag.resolution
        ranges = np.where(ranges > tag.max_range, np.inf, ranges)
        return np.where(ranges < tag.min_range, -np.inf, ranges)
