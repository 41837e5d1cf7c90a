# SPDX-License-Identifier: Apache-2.0
"""Publishes the lidars and cameras of a robot, each at its rate, for whoever listens."""

import array
import dataclasses
from typing import Any

from builtin_interfaces.msg import Time
import numpy as np
from rclpy.node import Node
from robot_description.description import Description
from sensor_msgs.msg import CameraInfo
from sensor_msgs.msg import Image
from sensor_msgs.msg import LaserScan
from wasd_core.messages import to_stamp
from wasd_core.streams import visible
from wasd_core.timing import Beat
from wasd_core.topics import has_listener
from wasd_core.topics import has_subscriber
from wasd_core.topics import RELIABLE

from mujoco_sim.errors import SimulationError
from mujoco_sim.parameters import SimulatorParameters
from mujoco_sim.sensors.camera import Camera
from mujoco_sim.sensors.camera import Offscreen
from mujoco_sim.sensors.lidar import Lidar
from mujoco_sim.sensors.mount import Snapshot
from mujoco_sim.sensors.tags import read_sensor_tags
from mujoco_sim.world import World

# What noise is drawn with; None where sensors tell the truth.
Random = np.random.Generator | None

# Of colours and of depths [m], by REP 118.
ENCODINGS = ('rgb8', '32FC1')


class SensorPublisher:
    """
    Measures and publishes on simulated time, only what somebody has subscribed to.

    While a picture is rendered, simulated time waits: what is seen does not depend on the
    machine. The noise of a measurement is drawn by seed, sensor and number of the measurement,
    so it does not depend on who listened before.
    """

    def __init__(
        self, node: Node, loaded: Description, world: World, settings: SimulatorParameters
    ) -> None:
        """
        Find the sensors in the robot's description; nothing is rendered yet.

        Raises:
            SimulationError: a sensor that cannot be, in one line.
        """
        self._world = world
        self._noise = settings.sensor_noise
        found = read_sensor_tags(loaded.robot)
        for note in found.notes:
            node.get_logger().warning(visible(note))
        prefix = world.prefix
        lidars = [dataclasses.replace(tag, frame=prefix + tag.frame) for tag in found.lidars]
        cameras = [dataclasses.replace(tag, frame=prefix + tag.frame) for tag in found.cameras]
        robot, snapshot = loaded.robot, Snapshot(world)
        scale = settings.camera_scale
        self._cameras = [Camera(tag, world, robot, snapshot, scale) for tag in cameras]
        self._renderer = _LazyRenderer(node, world, self._cameras)
        self._sensors: list[_LidarTopic | _CameraTopics] = []
        self._sensors += [_LidarTopic(node, Lidar(tag, world, robot, snapshot)) for tag in lidars]
        self._sensors += [_CameraTopics(node, camera, self._renderer) for camera in self._cameras]
        self.reset()

    def step(self) -> None:
        """Publish what is due now."""
        now = self._world.time
        for index, (beat, sensor) in enumerate(zip(self._beats, self._sensors, strict=True)):
            if beat.is_due(now - self._start, sensor.rate) and sensor.is_wanted:
                seed = [self._world.seed, index, beat.number]
                random = np.random.default_rng(seed) if self._noise else None
                sensor.publish(random, to_stamp(now))

    def reset(self) -> None:
        """Draw the noise again from its beginning, as the robot is back at its own."""
        self._start = self._world.time
        self._beats = [Beat() for _ in self._sensors]

    def resize(self, scale: float) -> None:
        """Take pictures of so much of the size that the description has, from now on."""
        for camera in self._cameras:
            camera.resize(scale)

    def close(self) -> None:
        """Release the renderer, if there is one."""
        self._renderer.close()


class _LidarTopic:
    """A lidar and its topic."""

    def __init__(self, node: Node, lidar: Lidar) -> None:
        self.rate = lidar.tag.rate
        self._lidar = lidar
        self._scan = node.create_publisher(LaserScan, lidar.tag.topic, RELIABLE)

    @property
    def is_wanted(self) -> bool:
        return has_listener(self._scan)

    def publish(self, random: Random, stamp: Time) -> None:
        self._scan.publish(to_laser_scan(self._lidar, self._lidar.scan(random), stamp))


class _CameraTopics:
    """A camera and its topics: images, and what one has to know of the lens."""

    def __init__(self, node: Node, camera: Camera, renderer: '_LazyRenderer') -> None:
        def publishers(kind: type, *topics: str) -> list[Any]:
            return [
                node.create_publisher(kind, topic, RELIABLE) if topic else None for topic in topics
            ]

        self.rate = camera.tag.rate
        self._node = node
        self._camera = camera
        self._renderer = renderer
        tag = camera.tag
        self._images = publishers(Image, tag.colour_topic, tag.depth_topic)
        infos = dict.fromkeys((tag.colour_info_topic, tag.depth_info_topic))
        self._infos = publishers(CameraInfo, *infos)

    @property
    def is_wanted(self) -> bool:
        return any(map(self._is_watched, self._images)) or any(map(_is_heard, self._infos))

    def publish(self, random: Random, stamp: Time) -> None:
        for info in filter(_is_heard, self._infos):
            info.publish(to_camera_info(self._camera, stamp))
        colour, depth = map(self._is_watched, self._images)
        offscreen = self._renderer.open() if colour or depth else None
        if offscreen is None:
            return
        picture = self._camera.take(offscreen, colour, depth, random)
        frame = self._camera.tag.frame
        for publisher, pixels, encoding in zip(self._images, picture, ENCODINGS, strict=True):
            if pixels is not None:
                publisher.publish(to_image(pixels, encoding, frame, stamp))

    def _is_watched(self, images: Any) -> bool:
        """Whether somebody looks: a recording of everything would be 80 MB a second."""
        return images is not None and has_subscriber(self._node, images)


class _LazyRenderer:
    """The one renderer of all cameras, made when the first picture is wanted."""

    def __init__(self, node: Node, world: World, cameras: list[Camera]) -> None:
        self._node = node
        self._world = world
        self._width = max((camera.tag.width for camera in cameras), default=0)
        self._height = max((camera.tag.height for camera in cameras), default=0)
        self._offscreen: Offscreen | None = None
        self._works = True

    def open(self) -> Offscreen | None:
        """Return the renderer; None, and one line in the log, where there cannot be one."""
        if self._offscreen is None and self._works:
            try:
                self._offscreen = Offscreen(self._world, self._width, self._height)
            except SimulationError as error:
                self._works = False
                self._node.get_logger().error(f'cameras have no pictures: {error}')
        return self._offscreen

    def close(self) -> None:
        """Release it."""
        if self._offscreen is not None:
            self._offscreen.close()
            self._offscreen = None


def _is_heard(publisher: Any) -> bool:
    return publisher is not None and has_listener(publisher)


def to_laser_scan(lidar: Lidar, ranges: np.ndarray, stamp: Time) -> LaserScan:
    """Return sensor_msgs/LaserScan; all rays are of one instant."""
    tag = lidar.tag
    message = LaserScan()
    message.header.stamp = stamp
    message.header.frame_id = tag.frame
    message.angle_min = tag.min_angle
    message.angle_max = tag.max_angle
    message.angle_increment = lidar.angle_increment
    message.scan_time = 1.0 / tag.rate
    message.range_min = tag.min_range
    message.range_max = tag.max_range
    message.ranges = array.array('f', ranges.astype(np.float32).tobytes())
    return message


def to_image(pixels: np.ndarray, encoding: str, frame: str, stamp: Time) -> Image:
    """Return sensor_msgs/Image of pixels, shape (height, width) or (height, width, channels)."""
    message = Image()
    message.header.stamp = stamp
    message.header.frame_id = frame
    message.height, message.width = pixels.shape[:2]
    message.encoding = encoding
    message.is_bigendian = 0
    message.step = pixels[0].nbytes
    message.data = array.array('B', pixels.tobytes())
    return message


def to_camera_info(camera: Camera, stamp: Time) -> CameraInfo:
    """Return sensor_msgs/CameraInfo of a pinhole without distortion."""
    focal, (x, y) = camera.focal_length, camera.centre
    message = CameraInfo()
    message.header.stamp = stamp
    message.header.frame_id = camera.tag.frame
    message.height, message.width = camera.height, camera.width
    message.distortion_model = 'plumb_bob'
    message.d = [0.0] * 5
    message.k = [focal, 0.0, x, 0.0, focal, y, 0.0, 0.0, 1.0]
    message.r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    message.p = [focal, 0.0, x, 0.0, 0.0, focal, y, 0.0, 0.0, 0.0, 1.0, 0.0]
    return message
