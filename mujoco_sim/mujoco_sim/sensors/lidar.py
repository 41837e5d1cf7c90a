# SPDX-License-Identifier: Apache-2.0
"""
A planar lidar: rays against everything that collides.

One that turns casts each ray from where it is then; an ideal one casts all in one instant.
"""

import array
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
import math

import mujoco
import numpy as np
from robot_description.mujoco.geoms import VISUAL_GROUP
from wasd_core.rotations import Pose

from mujoco_sim.parameters import IDEAL
from mujoco_sim.sensors.lidar_models import LIDAR_MODELS
from mujoco_sim.sensors.mount import Fields, Random, Site
from mujoco_sim.sensors.tags import legal_topic, SensorTag, TagReader
from robot_description import sensor_tags

# Rays ignore geoms that are only drawn: a lidar measures the same with and without a viewer.
SEEN_GROUPS = np.array([group != VISUAL_GROUP for group in range(mujoco.mjNGROUP)], dtype=np.uint8)
# A material with this in its name is glass. A ray goes through it, unless the angle of the ray to
# the normal is less than this [rad]: then the ray comes back.
GLASS, MIRROR = 'glass', math.radians(10.0)
MOST_PANES, BEHIND = 8, 1e-4  # that a ray goes through; how far behind one it goes on [m]
# Rays are cast together that are no more than so long apart [s]: the world stands still meanwhile,
# the lidar does not.
SLICE = 0.004


@dataclass(frozen=True, kw_only=True)
class LidarTag(SensorTag):
    """
    A planar lidar: rays from `min_angle` to `max_angle`, both included, about z [rad].

    The standard deviation of a range is `noise` [m], or `noise_share` of it where that is more.
    """

    topic: str
    samples: int
    min_angle: float
    max_angle: float
    min_range: float  # [m]
    max_range: float  # [m]
    resolution: float  # what ranges are rounded to [m]; 0 is not at all
    noise: float
    noise_share: float = 0.0
    dropouts: float = 0.0  # probability that a ray is lost
    turns: bool = False  # once in 1 / rate, each ray at its own time; else all are of one instant
    spokes: tuple[tuple[float, float], ...] = ()  # angles and widths of what stands before it

    @property
    def angles(self) -> np.ndarray:
        """Direction of each ray about z [rad], shape (samples,)."""
        return np.linspace(self.min_angle, self.max_angle, self.samples)

    @property
    def angle_increment(self) -> float:
        """Angle from one ray to the next [rad]."""
        return (self.max_angle - self.min_angle) / max(1, self.samples - 1)

    @property
    def time_increment(self) -> float:
        """Time from one ray to the next [s]; 0 where all are of one instant."""
        share = min(self.angle_increment / (2.0 * math.pi), 1.0 / max(1, self.samples - 1))
        return share / self.rate if self.turns else 0.0

    def deviations(self, ranges: np.ndarray) -> np.ndarray:
        """Return the standard deviations of ranges [m], shapes (n,)."""
        return np.maximum(self.noise, self.noise_share * ranges)

    def err(self, ranges: np.ndarray, random: Random) -> np.ndarray:
        """
        Return true ranges [m], shape (samples,), as they are measured, by REP 117.

        With a `random` generator they are noisy, and some are lost, +inf as if nothing was there.
        They are rounded to the resolution. Ranges beyond the maximum are +inf; ranges below the
        minimum, and those that a spoke hides, are -inf.
        """
        if random is not None:
            finite = np.where(np.isfinite(ranges), ranges, 0.0)
            ranges = ranges + self.deviations(finite) * random.normal(size=self.samples)
            if self.dropouts > 0.0:
                ranges = np.where(random.random(self.samples) < self.dropouts, np.inf, ranges)
        if self.resolution > 0.0:
            ranges = np.round(ranges / self.resolution) * self.resolution
        ranges = np.where(ranges > self.max_range, np.inf, ranges)
        ranges = np.where(ranges < self.min_range, -np.inf, ranges)
        for angle, width in self.spokes:
            off = (self.angles - angle + math.pi) % (2.0 * math.pi) - math.pi
            ranges = np.where(np.abs(off) <= 0.5 * width, -np.inf, ranges)
        return ranges


def read_lidar(reader: TagReader) -> LidarTag:
    """
    Return what a tag says of a lidar.

    A tag with a `model` of LIDAR_MODELS takes from it what the tag itself does not say.
    """
    if reader.number('scan/vertical/samples', 1) > 1:
        reader.notes.append(f'sensor {reader.name!r}: only one of its rows of rays is simulated')
    name = reader.word('model').lower() or IDEAL
    if name not in (IDEAL, *LIDAR_MODELS):
        wanted = ', '.join((IDEAL, *LIDAR_MODELS))
        reader.notes.append(
            f'sensor {reader.name!r}: model: wanted {wanted}, got {name!r}: taken as {IDEAL}'
        )
    model = LIDAR_MODELS.get(name)
    angles, ranges = sensor_tags.PAIRS[:2]
    low, high = reader.pair(*angles, (-math.pi, math.pi))
    nearest, farthest = reader.pair(
        *ranges, (model.min_range, model.max_range) if model else (0.0, 10.0)
    )
    return LidarTag(
        **reader.common(model.rate if model else 10.0),
        topic=legal_topic(reader.word('topicName', 'topic') or reader.remapped() or 'scan'),
        samples=int(reader.number('scan/horizontal/samples', model.samples if model else 360)),
        min_angle=low,
        max_angle=high,
        min_range=nearest,
        max_range=farthest,
        resolution=reader.number('range/resolution', 0.0),
        noise=reader.number('noise/stddev', model.noise if model else 0.0),
        noise_share=model.noise_share if model else 0.0,
        dropouts=model.dropouts if model else 0.0,
        turns=model is not None,
        spokes=_read_spokes(reader),
    )


def with_model(tag: LidarTag, name: str) -> LidarTag:
    """Return a lidar that is mounted as a tag says and measures as a model does, or ideally."""
    model = LIDAR_MODELS.get(name)
    if model is None:
        return replace(tag, noise_share=0.0, dropouts=0.0, turns=False)
    whole = (tag.max_angle - tag.min_angle) / (2.0 * math.pi)
    said = {**model._asdict(), 'samples': max(2, round(whole * model.samples))}
    return replace(tag, **said, resolution=0.0, turns=True)


def _read_spokes(reader: TagReader) -> tuple[tuple[float, float], ...]:
    """Return the angles and widths [rad] of `<spokes>`, numbers in turn; () if it is malformed."""
    try:
        numbers = [float(word) for word in reader.word('spokes').split()]
        if len(numbers) % 2 or not all(map(math.isfinite, numbers)):
            raise ValueError
    except ValueError:
        reader.notes.append(
            f'sensor {reader.name!r}: spokes: wanted pairs of angle and width, got '
            f'{reader.word("spokes")!r}: left out'
        )
        return ()
    return tuple(zip(numbers[::2], numbers[1::2], strict=True))


class Lidar:
    """
    Measures ranges; the body that carries it is transparent to its rays.

    `begin` and `step` are for one that turns: a revolution is measured as time goes on.
    """

    def __init__(self, tag: LidarTag, site: Site) -> None:
        self.tag = tag
        self._model = site.world.model
        self._snapshot = site.snapshot
        self._mount = site.find_mount(tag.link, tag.pose)
        angles = tag.angles
        self._directions = np.stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)))
        self._hits = np.empty(tag.samples, dtype=np.int32)
        self._distances = np.empty(tag.samples)
        self._normal = np.empty(3)  # of what a ray hits
        self._glass = _find_glass(self._model)
        self._turned = np.full(tag.samples, np.inf)  # ranges of this revolution
        self._count = 0  # of them are measured
        self._elapsed: float | None = None  # since it began [s]; None: there is none
        self._waited = 0.0  # since rays were cast [s]
        self._before: Pose | None = None  # where the lidar was then

    def true_ranges(self) -> np.ndarray:
        """Return the distance along each ray now [m], shape (samples,); inf where nothing is."""
        data = self._snapshot.take()
        sensor = self._mount.in_world(data)
        if self._glass.any():
            return self._cast(data, sensor, sensor, np.ones(self.tag.samples), 0)
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
            self.tag.max_range + 6.0 * float(self.tag.deviations(np.array(self.tag.max_range))),
        )
        return np.where(self._hits >= 0, self._distances, np.inf)

    @property
    def is_turning(self) -> bool:
        """Whether a revolution is being measured."""
        return self._elapsed is not None

    def begin(self, number: int, late: float) -> None:
        """Begin the revolution of a number, which its first ray has done `late` [s] ago."""
        self._count, self._elapsed = 0, late
        self._before, self._waited = None, 0.0

    def forget(self) -> None:
        """Break a revolution off."""
        self._elapsed, self._before, self._waited = None, None, 0.0

    def step(self, dt: float) -> np.ndarray | None:
        """
        Cast the rays of the last `dt` [s]; return true ranges when the last of them is cast.

        A ray begins where the lidar is at its time, between where it was at two calls.
        """
        self._waited += dt
        if self._elapsed is None:
            return None
        self._elapsed += dt
        increment = max(self.tag.time_increment, 1e-12)
        last = min(self.tag.samples, int(self._elapsed / increment + 1e-6) + 1)
        is_first = self._before is None
        if last < self.tag.samples and self._waited < SLICE and not is_first:
            return None
        data = self._snapshot.take()
        now = self._mount.in_world(data)
        before = now if self._before is None else self._before
        ago = self._elapsed - increment * np.arange(self._count, last)
        shares = np.clip(1.0 - ago / max(self._waited, 1e-12), 0.0, 1.0)
        self._turned[self._count : last] = self._cast(data, before, now, shares, self._count)
        self._count, self._before, self._waited = last, now, 0.0
        if last < self.tag.samples:
            return None
        self._elapsed = None
        return self._turned.copy()

    def _cast(
        self, data: mujoco.MjData, before: Pose, now: Pose, shares: np.ndarray, first: int
    ) -> np.ndarray:
        """Return how far some rays go [m], by their shares of the way between two poses."""
        rays = self._directions[:, first : first + len(shares)]
        along = (1.0 - shares) * (before.rotation @ rays) + shares * (now.rotation @ rays)
        along = (along / np.linalg.norm(along, axis=0)).T.copy()
        begins = np.outer(1.0 - shares, before.position) + np.outer(shares, now.position)
        return np.array(
            [self._cast_one(data, *ray) for ray in zip(begins, along, strict=True)], dtype=float
        )

    def _cast_one(self, data: mujoco.MjData, begin: np.ndarray, along: np.ndarray) -> float:
        """Return how far a ray goes to what is not glass, or is a mirror to it [m]; maybe inf."""
        hit, normal, way = self._hits[:1], self._normal, 0.0
        place = begin
        for _ in range(MOST_PANES):
            distance = mujoco.mj_ray(
                self._model,
                data,
                place,
                along,
                SEEN_GROUPS,
                True,
                self._mount.body,
                hit,
                normal,
            )
            if distance < 0.0:
                return math.inf
            way += float(distance)
            if not self._glass[hit[0]] or abs(float(normal @ along)) > math.cos(MIRROR):
                return way
            way += BEHIND
            place = begin + way * along
        return math.inf

    def scan(self, random: Random) -> np.ndarray:
        """Return ranges as they are measured now [m], shape (samples,); see `LidarTag.err`."""
        return self.tag.err(self.true_ranges(), random)

    def measure(self, wanted: Collection[str], random: Random) -> Iterator[tuple[str, Fields]]:
        """Yield the fields of a sensor_msgs/LaserScan; all rays are of one instant."""
        yield from self.measured(self.true_ranges(), random)

    def measured(self, ranges: np.ndarray, random: Random) -> Iterator[tuple[str, Fields]]:
        """Yield the fields of a sensor_msgs/LaserScan of a revolution's true ranges [m]."""
        tag = self.tag
        yield (
            'topic',
            {
                'angle_min': tag.min_angle,
                'angle_max': tag.max_angle,
                'angle_increment': tag.angle_increment,
                'time_increment': tag.time_increment,
                'scan_time': 1.0 / tag.rate,
                'range_min': tag.min_range,
                'range_max': tag.max_range,
                'ranges': array.array('f', tag.err(ranges, random).astype(np.float32).tobytes()),
            },
        )


def _find_glass(model: mujoco.MjModel) -> np.ndarray:
    """Return which geoms are of glass, shape (ngeom,)."""
    names = [model.material(number).name.lower() for number in range(model.nmat)]
    panes = np.array([GLASS in name for name in names], dtype=np.bool_)
    found = np.zeros(model.ngeom, dtype=np.bool_)
    has_material = model.geom_matid >= 0
    found[has_material] = panes[model.geom_matid[has_material]]
    return found
