# SPDX-License-Identifier: Apache-2.0
"""Lidars and cameras that a URDF declares, as Gazebo reads them: `<gazebo><sensor>` tags."""

from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace
import math
import re
from typing import NamedTuple, TypeVar
import xml.etree.ElementTree as ElementTree

import numpy as np
from robot_description.robot import Robot
from wasd_core.rotations import Pose
from wasd_core.rotations import rpy_matrix

from mujoco_sim.errors import SimulationError

# Words for one thing in Gazebo Classic and in its successor.
LIDAR_TYPES = ('ray', 'gpu_ray', 'lidar', 'gpu_lidar')
COLOUR_TYPES = ('camera',)
DEPTH_TYPES = ('depth', 'depth_camera')
CAMERA_TYPES = (*COLOUR_TYPES, *DEPTH_TYPES, 'rgbd', 'rgbd_camera')
# More than this is a typing error: rays of a scan, pixels of an image's side.
MOST_RAYS = 100_000
LARGEST_IMAGE = 4096


@dataclass(frozen=True, kw_only=True)
class SensorTag:
    """A sensor: `pose` is its own frame, x ahead, in the link's; `frame` is what it stamps."""

    name: str
    link: str
    pose: Pose
    frame: str
    rate: float  # [Hz] of simulated time


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


@dataclass(frozen=True, kw_only=True)
class CameraTag(SensorTag):
    """A camera that looks along x of its frame; a topic is empty where it makes no such image."""

    colour_topic: str
    colour_info_topic: str
    depth_topic: str
    depth_info_topic: str
    width: int  # [pixels]
    height: int
    field_of_view: float  # horizontal [rad]
    near: float  # what is nearer is not seen [m]
    far: float
    noise: float  # standard deviation of colour, as a share of full brightness


IMAGE_TOPICS = ('colour_topic', 'colour_info_topic', 'depth_topic', 'depth_info_topic')
Tag = TypeVar('Tag', LidarTag, CameraTag)


class SensorTags(NamedTuple):
    """Lidars and cameras of a description, and in words what of them is not simulated."""

    lidars: list[LidarTag]
    cameras: list[CameraTag]
    notes: list[str]


def read_sensor_tags(robot: Robot) -> SensorTags:
    """
    Return the lidars and cameras of a robot; sensors of other kinds are left to others.

    Topics are relative, so that a namespace prefixes them; what ROS does not allow in a name
    becomes `_`. Where two sensors would publish one topic, both get their sensor's name before it.

    Raises:
        SimulationError: a value that cannot be; names the sensor.
    """
    lidars: list[LidarTag] = []
    cameras: list[CameraTag] = []
    notes: list[str] = []
    for gazebo in robot.gazebo:
        link = gazebo.get('reference', '')
        for sensor in gazebo.findall('sensor'):
            kind = sensor.get('type', '')
            if kind not in LIDAR_TYPES + CAMERA_TYPES:
                continue
            reader = _Reader(sensor, link)
            if link not in robot.links:
                notes.append(f'sensor {reader.name!r} is on {link!r}, which is no link: left out')
            elif kind in LIDAR_TYPES:
                lidars.append(_lidar(reader))
                if reader.number(_scan('vertical/samples'), 1) > 1:
                    notes.append(f'sensor {reader.name!r}: of its rows of rays, one is simulated')
            else:
                cameras.append(_camera(reader, kind))
    return SensorTags(_separate(lidars, ('topic',)), _separate(cameras, IMAGE_TOPICS), notes)


def has_camera(robot: Robot) -> bool:
    """Return whether a robot needs others, and itself, to be there to be looked at."""
    return bool(read_sensor_tags(robot).cameras)


class _Reader:
    """Reads one `<sensor>`: numbers with their bounds, names of topics and frames."""

    def __init__(self, tag: ElementTree.Element, link: str) -> None:
        self.tag = tag
        self.name = tag.get('name', '') or tag.get('type', '')
        self.link = link

    def number(
        self, paths: str, default: float, least: float = -math.inf, most: float = math.inf
    ) -> float:
        """Return the first of some elements (separated by spaces) as a number in its bounds."""
        text = self._text(paths)
        try:
            value = default if text is None else float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and least <= value <= most):
            bounds = [f'>= {least:g}'] if math.isfinite(least) else []
            bounds += [f'<= {most:g}'] if math.isfinite(most) else []
            raise SimulationError(
                f'sensor {self.name!r}: {paths.split()[0]} must be '
                f'{" ".join(["a number", " and ".join(bounds)]).strip()}, got {text!r}'
            )
        return value

    def pose(self) -> Pose:
        """Return the sensor's own `<pose>` in its link; SDF writes it as x y z roll pitch yaw."""
        text = self.tag.findtext('pose') or '0 0 0 0 0 0'
        try:
            x, y, z, roll, pitch, yaw = (float(word) for word in text.split())
        except ValueError:
            raise SimulationError(
                f'sensor {self.name!r}: pose must be 6 numbers, got {text!r}'
            ) from None
        return Pose(np.array([x, y, z]), rpy_matrix(roll, pitch, yaw))

    def word(self, *names: str) -> str:
        """Return the text of the first of some elements of the plugin or the sensor, or ''."""
        for name in names:
            for path in (f'plugin/{name}', name):
                text = self.tag.findtext(path)
                if text and text.strip():
                    return text.strip().strip('/')
        return ''

    def remapped(self) -> str:
        """Return where a ROS 2 plugin sends its output: `<remapping>~/out:=scan</remapping>`."""
        for tag in self.tag.iterfind('plugin/ros/remapping'):
            ours, _, theirs = (tag.text or '').strip().partition(':=')
            if ours.endswith('out'):
                return theirs.strip('/')
        return ''

    def frame(self) -> str:
        """Return the frame that messages are stamped with."""
        names = ('frameName', 'frame_name', 'gz_frame_id', 'ignition_frame_id')
        return self.word(*names) or self.link

    def _text(self, paths: str) -> str | None:
        texts = (self.tag.findtext(path) for path in paths.split())
        return next((text for text in texts if text is not None), None)


def _ray(tail: str) -> str:
    """Return where both Gazebos have something of a lidar."""
    return f'ray/{tail} lidar/{tail}'


def _scan(tail: str) -> str:
    return _ray(f'scan/{tail}')


def _lidar(reader: _Reader) -> LidarTag:
    low = reader.number(_scan('horizontal/min_angle'), -math.pi)
    nearest = reader.number(_ray('range/min'), 0.0, 0.0)
    return LidarTag(
        name=reader.name,
        link=reader.link,
        pose=reader.pose(),
        frame=reader.frame(),
        rate=reader.number('update_rate', 10.0, 0.001),
        topic=_legal(reader.word('topicName', 'topic') or reader.remapped() or 'scan'),
        samples=int(reader.number(_scan('horizontal/samples'), 360, 1, MOST_RAYS)),
        min_angle=low,
        max_angle=reader.number(_scan('horizontal/max_angle'), math.pi, low),
        min_range=nearest,
        max_range=reader.number(_ray('range/max'), 10.0, nearest),
        resolution=reader.number(_ray('range/resolution'), 0.0, 0.0),
        noise=reader.number(f'{_ray("noise/stddev")} noise/stddev', 0.0, 0.0),
    )


def _camera(reader: _Reader, kind: str) -> CameraTag:
    name = reader.word('cameraName', 'camera_name') or reader.name
    colour = reader.word('imageTopicName')
    if kind not in DEPTH_TYPES:
        colour = colour or 'image_raw'
    depth = reader.word('depthImageTopicName') or 'depth/image_raw'
    if kind in COLOUR_TYPES:
        depth = ''

    def topic(image: str) -> str:
        return _legal(f'{name}/{image}') if image else ''

    def info(element: str, image: str) -> str:
        beside = image.rpartition('/')[0]
        return topic(reader.word(element) or f'{beside}/camera_info'.strip('/')) if image else ''

    near = reader.number('camera/clip/near', 0.05, 0.001)
    return CameraTag(
        name=reader.name,
        link=reader.link,
        pose=reader.pose(),
        frame=reader.frame(),
        rate=reader.number('update_rate', 30.0, 0.001),
        colour_topic=topic(colour),
        colour_info_topic=info('cameraInfoTopicName', colour),
        depth_topic=topic(depth),
        depth_info_topic=info('depthImageCameraInfoTopicName', depth),
        width=int(reader.number('camera/image/width', 640, 1, LARGEST_IMAGE)),
        height=int(reader.number('camera/image/height', 480, 1, LARGEST_IMAGE)),
        field_of_view=reader.number('camera/horizontal_fov', math.pi / 3.0, 0.01, 3.0),
        near=near,
        far=reader.number('camera/clip/far', 100.0, 1.01 * near),
        noise=reader.number('camera/noise/stddev noise/stddev', 0.0, 0.0),
    )


def _legal(topic: str) -> str:
    """Return a topic of words that ROS allows: letters, digits and `_`, no digit first."""
    words = (re.sub(r'\W', '_', word, flags=re.ASCII) for word in topic.split('/') if word)
    return '/'.join(f'_{word}' if word[0].isdigit() else word for word in words)


def _separate(tags: Sequence[Tag], names: Sequence[str]) -> list[Tag]:
    """Put the sensor's name before its topics where one of them, by field names, is another's."""
    topics = [getattr(tag, name) for tag in tags for name in names]
    separate = []
    for tag in tags:
        used = {name: getattr(tag, name) for name in names if getattr(tag, name)}
        if any(topics.count(topic) > 1 for topic in used.values()):
            used = {name: _legal(f'{tag.name}/{topic}') for name, topic in used.items()}
        separate.append(replace(tag, **used))
    return separate
