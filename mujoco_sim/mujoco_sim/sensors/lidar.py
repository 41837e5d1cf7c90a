# SPDX-License-Identifier: Apache-2.0
"""A planar lidar: rays from one point against everything that collides."""

import array
from collections.abc import Collection, Iterator
from dataclasses import dataclass
import math

import mujoco
import numpy as np
from robot_description.mujoco.geoms import VISUAL_GROUP

from mujoco_sim.sensors.mount import Fields, Random, Site
from mujoco_sim.sensors.tags import legal_topic, SensorTag, TagReader
from robot_description import sensor_tags

# What is there to be looked at only is not there for a lidar: it sees the same without a viewer.
SEEN_GROUPS = np.array([group != VISUAL_GROUP for group in range(mujoco.mjNGROUP)], dtype=np.uint8)


@dataclass(frozen=True, kw_only=True)
class LidarTag(SensorTag):
    """A planar lidar: rays from `min_angle` to `max_angle`, both included, about z [rad]."""

    topic: str
    samples: int
    min_angle: float
    max_angle: float
    min_range: float  # [m]
    max_range: float  # [m]
    resolution: float  # what ranges are rounded to [m]; 0 is not at all
    noise: float  # standard deviation [m]

    @property
    def angles(self) -> np.ndarray:
        """Direction of each ray about z [rad], shape (samples,)."""
        return np.linspace(self.min_angle, self.max_angle, self.samples)


def read_lidar(reader: TagReader) -> LidarTag:
    """Return what a tag says of a lidar."""
    if reader.number('scan/vertical/samples', 1) > 1:
        reader.notes.append(f'sensor {reader.name!r}: of its rows of rays, one is simulated')
    angles, ranges = sensor_tags.PAIRS[:2]
    low, high = reader.pair(*angles, (-math.pi, math.pi))
    nearest, farthest = reader.pair(*ranges, (0.0, 10.0))
    return LidarTag(
        **reader.common(10.0),
        topic=legal_topic(reader.word('topicName', 'topic') or reader.remapped() or 'scan'),
        samples=int(reader.number('scan/horizontal/samples', 360)),
        min_angle=low,
        max_angle=high,
        min_range=nearest,
        max_range=farthest,
        resolution=reader.number('range/resolution', 0.0),
        noise=reader.number('noise/stddev', 0.0),
    )


class Lidar:
    """Measures ranges; the body that carries it is transparent to its rays."""

    def __init__(self, tag: LidarTag, site: Site) -> None:
        self.tag = tag
        self._model = site.world.model
        self._snapshot = site.snapshot
        self._mount = site.find_mount(tag.link, tag.pose)
        angles = tag.angles
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

    def scan(self, random: Random) -> np.ndarray:
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

    def measure(self, wanted: Collection[str], random: Random) -> Iterator[tuple[str, Fields]]:
        """Yield the fields of a sensor_msgs/LaserScan; all rays are of one instant."""
        tag = self.tag
        yield (
            'topic',
            {
                'angle_min': tag.min_angle,
                'angle_max': tag.max_angle,
                'angle_increment': self.angle_increment,
                'scan_time': 1.0 / tag.rate,
                'range_min': tag.min_range,
                'range_max': tag.max_range,
                'ranges': array.array('f', self.scan(random).astype(np.float32).tobytes()),
            },
        )
