# SPDX-License-Identifier: Apache-2.0
"""
A lidar that measures a cloud of points, ray after ray, each at its own time.

Its beam nods in a fast circle while the head turns slowly: no ray goes where the last turn's went.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
import math
from typing import NamedTuple

import mujoco
import numpy as np
from wasd_core.rotations import Pose

from mujoco_sim.sensors.lidar import SEEN_GROUPS
from mujoco_sim.sensors.mount import Fields, Random, Site
from mujoco_sim.sensors.tags import legal_topic, SensorTag, TagReader


class CloudModel(NamedTuple):
    """
    A lidar of points.

    A ray that meets something at a range r comes back with the probability
    `returned` / (1 + (r / `sparse`)^2). The standard deviation of a range is `noise` [m].
    """

    rate: float  # clouds in a second [Hz]
    points: int  # rays in a second
    nods: int  # of the beam, between upright and level, in a second
    turns: int  # of the head in a second
    min_range: float  # [m]
    max_range: float  # [m]
    noise: float  # [m]
    returned: float
    sparse: float  # [m]


# Rays, field of view and ranges are of the data sheet; users call it useful up to 5 m and sparse
# beyond 2 to 4 m: how many rays are lost is fitted to that, a guess.
CLOUD_MODELS = {
    'l1': CloudModel(15.0, 21_600, 180, 11, 0.05, 30.0, 0.02, 0.95, 5.0),  # Unitree 4D L1
}
# Upright to level: the sheet's 360 x 90 degrees.
HIGHEST = 0.5 * math.pi
# The rays of one nod are a ring: so many numbers there are before they begin again.
MOST_RINGS = 18
# As Unitree lays a point out: x y z [m], intensity, ring, time since the first [s].
POINT = np.dtype(
    {
        'names': ['x', 'y', 'z', 'intensity', 'ring', 'time'],
        'formats': ['<f4', '<f4', '<f4', '<f4', '<u2', '<f4'],
        'offsets': [0, 4, 8, 16, 20, 24],
        'itemsize': 32,
    }
)


@dataclass(frozen=True, kw_only=True)
class CloudTag(SensorTag):
    """A lidar of points about its own frame's z; `alias` is a second topic of the same."""

    topic: str
    alias: str
    model: CloudModel

    @property
    def turns(self) -> bool:
        """Whether each ray has its own time."""
        return True

    def directions(self, times: np.ndarray) -> np.ndarray:
        """Return the unit vectors of rays at times [s], shape (n, 3)."""
        model = self.model
        azimuth = 2.0 * math.pi * model.turns * times
        height = 0.5 * HIGHEST * (1.0 - np.cos(2.0 * math.pi * model.nods * times))
        level = np.cos(height)
        return np.stack((level * np.cos(azimuth), level * np.sin(azimuth), np.sin(height)), axis=1)

    def rings(self, times: np.ndarray) -> np.ndarray:
        """Return the number of the ring that rays at times [s] are of, shape (n,)."""
        return np.asarray(np.floor(times * self.model.nods).astype(int) % MOST_RINGS)

    def err(self, ranges: np.ndarray, random: Random) -> np.ndarray:
        """Return true ranges [m], shape (n,), as they are measured; inf for rays that are lost."""
        model = self.model
        measured = ranges.copy()
        if random is not None:
            finite = np.where(np.isfinite(ranges), ranges, 0.0)
            measured = measured + model.noise * random.normal(size=len(ranges))
            back = model.returned / (1.0 + (finite / model.sparse) ** 2)
            measured[random.random(len(ranges)) > back] = np.inf
        measured[(measured < model.min_range) | (measured > model.max_range)] = np.inf
        return measured


def is_cloud(reader: TagReader) -> bool:
    """Whether a tag's `model` is a lidar of points."""
    return reader.word('model').lower() in CLOUD_MODELS


def read_cloud(reader: TagReader) -> CloudTag:
    """Return what a tag says of a lidar of points: its place, its topics, its model."""
    model = CLOUD_MODELS[reader.word('model').lower()]
    alias = reader.word('alias')
    return CloudTag(
        **reader.common(model.rate),
        topic=legal_topic(reader.word('topicName', 'topic') or reader.remapped() or 'points'),
        alias=legal_topic(alias) if alias else '',
        model=model,
    )


class Cloud(NamedTuple):
    """Rays of one cloud: their times since it began [s], directions (n, 3), true ranges [m]."""

    times: np.ndarray
    directions: np.ndarray
    ranges: np.ndarray
    rings: np.ndarray


class PointLidar:
    """Measures clouds as time goes on; the robot that carries it is not in them."""

    def __init__(self, tag: CloudTag, site: Site) -> None:
        self.tag = tag
        self._model = site.world.model
        self._snapshot = site.snapshot
        self._mount = site.find_mount(tag.link, tag.pose)
        own = self._model.body_rootid[self._mount.body]
        self._is_own = self._model.body_rootid[self._model.geom_bodyid] == own
        # All begins again after a second: so many directions and rings there are.
        times = np.arange(tag.model.points) / tag.model.points
        self._directions, self._rings = tag.directions(times), tag.rings(times)
        count = math.ceil(tag.model.points / tag.rate) + 1
        self._hits = np.empty(count, dtype=np.int32)
        self._distances = np.empty(count)
        self._count = 0  # of its rays are cast
        self._elapsed: float | None = None  # since it began [s]; None: there is none

    @property
    def is_turning(self) -> bool:
        """Whether a cloud is being measured."""
        return self._elapsed is not None

    def begin(self, number: int, late: float) -> None:
        """Begin the cloud of a number, which its first ray has done `late` [s] ago."""
        points, rate = self.tag.model.points, self.tag.rate
        # Numbers of its rays, from the start of all.
        first, last = round(number * points / rate), round((number + 1) * points / rate)
        rays, numbers = np.arange(first, last) % points, np.arange(last - first)
        self._cloud = Cloud(
            numbers / points, self._directions[rays], np.empty(len(rays)), self._rings[rays]
        )
        self._count, self._elapsed = 0, late

    def forget(self) -> None:
        """Break a cloud off."""
        self._elapsed = None

    def step(self, dt: float) -> Cloud | None:
        """
        Cast the rays of the last `dt` [s] from where the lidar is now; return a cloud at its end.

        The rays of one step are from one place: a step is 2 ms, in which a Go2 that trots at
        0.5 m/s has moved by 1 mm.
        """
        if self._elapsed is None:
            return None
        self._elapsed += dt
        whole = len(self._cloud.ranges)
        last = min(whole, int(self._elapsed * self.tag.model.points + 1e-6) + 1)
        if last > self._count:
            self._cast(self._count, last)
            self._count = last
        if last < whole:
            return None
        self._elapsed = None
        return self._cloud

    def _cast(self, first: int, last: int) -> None:
        directions, count = self._cloud.directions[first:last], last - first
        data = self._snapshot.take()
        sensor: Pose = self._mount.in_world(data)
        mujoco.mj_multiRay(
            self._model,
            data,
            sensor.position,
            (directions @ sensor.rotation.T).flatten(),
            SEEN_GROUPS,
            True,
            self._mount.body,
            self._hits[:count],
            self._distances[:count],
            None,
            count,
            self.tag.model.max_range + 6.0 * self.tag.model.noise,
        )
        hits = self._hits[:count]
        is_seen = (hits >= 0) & ~self._is_own[hits]
        self._cloud.ranges[first:last] = np.where(is_seen, self._distances[:count], np.inf)

    def measured(self, cloud: Cloud, random: Random) -> Iterator[tuple[str, Fields]]:
        """Yield the points of a cloud, an array of POINT in the lidar's frame, for each topic."""
        ranges = self.tag.err(cloud.ranges, random)
        seen = np.isfinite(ranges)
        points = np.zeros(int(seen.sum()), dtype=POINT)
        places = cloud.directions[seen] * ranges[seen, None]
        points['x'], points['y'], points['z'] = places.T
        points['intensity'] = 100.0 / (1.0 + ranges[seen])
        points['ring'], points['time'] = cloud.rings[seen], cloud.times[seen]
        for topic in ('topic', 'alias'):
            yield topic, {'points': points}


def idealised(tag: CloudTag) -> CloudTag:
    """Return a lidar of points without noise, which loses no ray."""
    return replace(tag, model=tag.model._replace(noise=0.0, returned=1.0, sparse=math.inf))
