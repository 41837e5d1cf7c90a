# SPDX-License-Identifier: Apache-2.0
"""Measures by the sensors of a robot, each at its rate, for listeners."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
import math
from typing import Any

import numpy as np
from robot_description.description import Description
from wasd_core.rotations import Pose
from wasd_core.timing import Beat, ROUNDING

from mujoco_sim.parameters import HONEST, IDEAL, SimulatorParameters
from mujoco_sim.sensors.cloud import CloudTag, idealised
from mujoco_sim.sensors.lidar import LidarTag, with_model
from mujoco_sim.sensors.mount import Fields, Mount, Site
from mujoco_sim.sensors.table import read_sensor_tags, SENSORS
from mujoco_sim.sensors.tags import SensorTag
from mujoco_sim.world import World

# Takes the time of a measurement [s] and what the message of it says.
Receive = Callable[[float, Fields], None]


@dataclass
class SensorTopic:
    """
    A topic of a sensor, relative; the type of sensor_msgs that it has, its frame and rate [Hz].

    `mount` is where that frame is fixed to the robot.
    """

    name: str
    kind: str
    frame: str
    rate: float
    mount: Mount
    listeners: list[tuple[Receive, Callable[[], bool]]] = field(default_factory=list)

    def listen(self, receive: Receive, wants: Callable[[], bool] = lambda: True) -> None:
        """Give `receive` what is measured while it `wants` that."""
        self.listeners.append((receive, wants))


class Sensors:
    """
    Measures on simulated time, only what somebody wants.

    While a picture is rendered, simulated time waits: what is seen does not depend on the
    machine. The noise of a measurement is drawn by seed, sensor and number of the measurement,
    so it does not depend on who listened before. `tags` are as they are described, `notes` what is
    not simulated, in words; `frames` those of sensors that are no link: the link, the frame, its
    pose in the link.
    """

    def __init__(
        self,
        loaded: Description,
        world: World,
        settings: SimulatorParameters,
        say: Callable[[str], Any] = lambda text: None,
    ) -> None:
        """
        Find the sensors in the robot's description; nothing is rendered yet.

        `say` hears what does not work.
        """
        self._world = world
        found = read_sensor_tags(loaded.robot)
        self.tags = [tag for tags in found.kinds for tag in tags]
        self.notes = found.notes
        self._site = Site(world, loaded.robot, settings.camera_scale, say)
        self.tune(settings)
        self._sensors: list[_SensorTopics] = []
        self.frames: list[tuple[str, str, Pose]] = []
        self._start = self._stepped = world.tick
        self._idle_until = -math.inf  # nothing is due before, since the start [s]
        self._beats: list[Beat] = []
        for tags, kind in zip(found.kinds, SENSORS, strict=True):
            for tag in tags:
                own = replace(tag, frame=world.prefix + tag.frame)
                if tag.has_own_frame:
                    self.frames.append((world.prefix + tag.link, own.frame, tag.pose))
                if isinstance(own, LidarTag) and settings.lidar != HONEST:
                    own = with_model(own, settings.lidar)
                elif isinstance(own, CloudTag) and settings.lidar == IDEAL:
                    own = idealised(own)
                built = kind.build(own, self._site)
                mount = self._site.find_mount(own.link, own.pose)
                self._sensors.append(_SensorTopics(own, built, kind.topics, mount))
        self.reset()

    @property
    def topics(self) -> list[SensorTopic]:
        """All topics, those of one sensor after those of another."""
        return [topic for sensor in self._sensors for topic in sensor.topics.values()]

    def listen(self, topic: str, receive: Receive) -> None:
        """Give what is measured for a topic, by its relative name, to `receive`."""
        for one in self.topics:
            if one.name == topic:
                one.listen(receive)

    def step(self) -> None:
        """Measure what is due now."""
        world, now = self._world, self._since_start()
        dt, self._stepped = (world.tick - self._stepped) * world.time_step, world.tick
        if now < self._idle_until:
            return
        for index, (beat, one) in enumerate(zip(self._beats, self._sensors, strict=True)):
            before, is_due = beat.number, beat.is_due(now, one.rate)
            if one.turns:
                if is_due or one.sensor.is_turning:
                    self._turn(index, one, dt, (before, beat.number))
            elif is_due and (wanted := one.wanted()):
                measured = one.sensor.measure(wanted, self._random(index, beat.number))
                _tell(world.time, measured, wanted)
        self._idle_until = self._next_beat()

    def rest(self) -> float:
        """Return for how long from now [s] nothing is due."""
        return self._idle_until - self._since_start()

    def _since_start(self) -> float:
        """Return the time [s] since the start or the last reset, bit for bit the same."""
        return (self._world.tick - self._start) * self._world.time_step

    def _next_beat(self) -> float:
        """Return for how long since the start [s] nothing is due; -infinity while one turns."""
        if any(one.turns and one.sensor.is_turning for one in self._sensors):
            return -math.inf
        both = zip(self._beats, self._sensors, strict=True)
        ahead = min(((beat.number + 1) / one.rate for beat, one in both), default=math.inf)
        return ahead - 2.0 * ROUNDING

    def _turn(self, index: int, one: '_SensorTopics', dt: float, numbers: tuple[int, int]) -> None:
        """
        Let a sensor turn by a step of `dt` [s], and begin to measure where its number is new.

        A measurement has the time of its first ray. The sensor turns while somebody listens; a
        new listener waits for the next measurement.
        """
        sensor, number = one.sensor, numbers[0]
        is_new = numbers[1] != number
        # A beat is up to ROUNDING early: a last ray that is due with it comes then, too.
        ahead = 2.0 * ROUNDING if is_new else 0.0
        whole = sensor.step(dt + ahead) if sensor.is_turning else None
        if whole is None and not is_new:
            return
        wanted = one.wanted()
        if whole is not None:
            began = self._start * self._world.time_step + number / one.rate
            _tell(began, sensor.measured(whole, self._random(index, number)), wanted)
        if not wanted:
            sensor.forget()
        elif is_new:
            late = max(0.0, self._since_start() - numbers[1] / one.rate)
            sensor.begin(numbers[1], late)
            sensor.step(0.0)

    def _random(self, index: int, number: int) -> np.random.Generator | None:
        """Return what the noise of a measurement of a sensor is drawn with."""
        seed = [self._world.seed, index, number]
        return np.random.default_rng(seed) if self._has_noise else None

    def reset(self) -> None:
        """Draw the noise again from its beginning, as the robot is back at its own."""
        self._start = self._stepped = self._world.tick
        self._idle_until = -math.inf
        self._beats = [Beat() for _ in self._sensors]
        for one in self._sensors:
            if one.turns:
                one.sensor.forget()

    def tune(self, settings: SimulatorParameters) -> None:
        """Set whether there is noise, and the share of the described size that pictures have."""
        self._has_noise = settings.sensor_noise
        self._site.scale = settings.camera_scale

    def close(self) -> None:
        """Release the renderer, if there is one."""
        self._site.close()


def _tell(
    now: float, measured: Iterable[tuple[str, Fields]], wanted: dict[str, list[Receive]]
) -> None:
    """Give measurements of a time [s] to the receivers that want them."""
    for topic, fields in measured:
        for receive in wanted.get(topic, ()):
            receive(now, fields)


class _SensorTopics:
    """A sensor and its topics; two of one name, as of a lens that two pictures share, are one."""

    def __init__(
        self,
        tag: SensorTag,
        sensor: Any,
        topics: dict[str, str],
        mount: Mount,
    ) -> None:
        self.rate = tag.rate
        self.turns: bool = getattr(tag, 'turns', False)
        self.sensor = sensor
        self.topics: dict[str, SensorTopic] = {}  # by the fields of the tag
        names: set[str] = set()
        for place, kind in topics.items():
            name = getattr(tag, place)
            if name and name not in names:
                names.add(name)
                self.topics[place] = SensorTopic(name, kind, tag.frame, tag.rate, mount)

    def wanted(self) -> dict[str, list[Receive]]:
        """Return the receivers that want something now, by field of the tag; no empty lists."""
        found = {
            place: [receive for receive, wants in topic.listeners if wants()]
            for place, topic in self.topics.items()
        }
        return {place: receivers for place, receivers in found.items() if receivers}
