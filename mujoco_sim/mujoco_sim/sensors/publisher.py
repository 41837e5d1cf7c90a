# SPDX-License-Identifier: Apache-2.0
"""Publishes what the sensors of a robot measure, each at its rate, for whoever listens."""

from collections.abc import Callable
import dataclasses
from typing import Any

from builtin_interfaces.msg import Time
import numpy as np
from rclpy.node import Node
from robot_description.description import Description
import sensor_msgs.msg
from std_msgs.msg import Header
from wasd_core.messages import to_stamp
from wasd_core.streams import visible
from wasd_core.timing import Beat
from wasd_core.topics import has_listener, has_subscriber, RELIABLE

from mujoco_sim.parameters import SimulatorParameters
from mujoco_sim.sensors.mount import Random, Site
from mujoco_sim.sensors.table import read_sensor_tags, Sensor, SENSORS
from mujoco_sim.sensors.tags import SensorTag
from mujoco_sim.world import World

# Made only when somebody looks: a recording of everything would be 80 MB a second.
LARGE = ('Image', 'PointCloud2')


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
        """Find the sensors in the robot's description; nothing is rendered yet."""
        self._world = world
        self._noise = settings.sensor_noise
        found = read_sensor_tags(loaded.robot)
        for note in found.notes:
            node.get_logger().warning(visible(note))
        self._site = Site(world, loaded.robot, settings.camera_scale, node.get_logger().error)
        self._sensors = []
        for tags, kind in zip(found.kinds, SENSORS, strict=True):
            for tag in tags:
                own = dataclasses.replace(tag, frame=world.prefix + tag.frame)
                sensor = kind.build(own, self._site)
                self._sensors.append(_SensorTopics(node, own, sensor, kind.topics))
        self.reset()

    def step(self) -> None:
        """Publish what is due now."""
        now = self._world.time
        for index, (beat, sensor) in enumerate(zip(self._beats, self._sensors, strict=True)):
            if beat.is_due(now - self._start, sensor.rate) and (wanted := sensor.wanted()):
                seed = [self._world.seed, index, beat.number]
                random = np.random.default_rng(seed) if self._noise else None
                sensor.publish(wanted, random, to_stamp(now))

    def hand_over(self, topic: str, receive: Callable[[Any], None]) -> None:
        """Give what is published on a topic to `receive`, too: it counts as a listener."""
        for sensor in self._sensors:
            sensor.receivers.setdefault(topic, []).append(receive)

    def reset(self) -> None:
        """Draw the noise again from its beginning, as the robot is back at its own."""
        self._start = self._world.time
        self._beats = [Beat() for _ in self._sensors]

    def resize(self, scale: float) -> None:
        """Take pictures of so much of the size that the description has, from now on."""
        self._site.scale = scale

    def close(self) -> None:
        """Release the renderer, if there is one."""
        self._site.close()


class _SensorTopics:
    """A sensor and its topics; two of one name, as of a lens that two pictures share, are one."""

    def __init__(self, node: Node, tag: SensorTag, sensor: Sensor, topics: dict[str, str]) -> None:
        self.rate = tag.rate
        self._node = node
        self._frame = tag.frame
        self._sensor = sensor
        self._publishers: dict[str, Any] = {}
        self._names: dict[str, str] = {}
        self.receivers: dict[str, list[Callable[[Any], None]]] = {}  # by relative names of topics
        self._large: set[str] = set()
        names: set[str] = set()
        for field, kind in topics.items():
            name = getattr(tag, field)
            if name and name not in names:
                names.add(name)
                self._names[field] = name
                message_type = getattr(sensor_msgs.msg, kind)
                self._publishers[field] = node.create_publisher(message_type, name, RELIABLE)
                self._large |= {field} if kind in LARGE else set()

    def wanted(self) -> list[str]:
        """Return the topics that somebody wants now, by the fields of the tag."""
        return [field for field in self._publishers if self._is_wanted(field)]

    def publish(self, wanted: list[str], random: Random, stamp: Time) -> None:
        header = Header(stamp=stamp, frame_id=self._frame)
        for field, fields in self._sensor.measure(wanted, random):
            publisher = self._publishers[field]
            message = publisher.msg_type(header=header, **fields)
            publisher.publish(message)
            for receive in self.receivers.get(self._names[field], ()):
                receive(message)

    def _is_wanted(self, field: str) -> bool:
        publisher = self._publishers[field]
        if self._names[field] in self.receivers:
            return True
        if field in self._large:
            return has_subscriber(self._node, publisher)
        return has_listener(publisher)
