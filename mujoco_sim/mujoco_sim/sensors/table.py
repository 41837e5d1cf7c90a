# SPDX-License-Identifier: Apache-2.0
"""The kinds of sensors that there are, a row each, and those that a URDF declares."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from robot_description.robot import Robot
from robot_description.sensor_tags import CAMERA_TYPES, LIDAR_TYPES

from mujoco_sim.sensors.camera import Camera, read_camera
from mujoco_sim.sensors.cloud import is_cloud, PointLidar, read_cloud
from mujoco_sim.sensors.lidar import Lidar, read_lidar
from mujoco_sim.sensors.mount import Site
from mujoco_sim.sensors.tags import legal_topic, SensorTag, TagReader
from robot_description import sensor_tags


class SensorKind(NamedTuple):
    """
    A row of SENSORS.

    `types` are the words of `<sensor type="...">`; `read` makes a tag of one, `build` a sensor of
    a tag and a site. `Camera` shows what a sensor has that measures in one instant, `PointLidar`
    what one has that measures as time goes on, whose tag `turns`. `topics` has the fields of the
    tag that name topics, and the type of sensor_msgs that is published there; one that is empty in
    a tag is not. `takes` tells rows of the same types apart.
    """

    types: tuple[str, ...]
    read: Callable[[TagReader], SensorTag]
    build: Callable[[Any, Site], Any]
    topics: dict[str, str]
    takes: Callable[[TagReader], bool] = lambda reader: True


_IMAGES = {'colour_topic': 'Image', 'depth_topic': 'Image'}
_CLOUDS = {'topic': 'PointCloud2', 'alias': 'PointCloud2'}
_LENSES = {'colour_info_topic': 'CameraInfo', 'depth_info_topic': 'CameraInfo'}
SENSORS = [
    SensorKind(
        LIDAR_TYPES,
        read_lidar,
        Lidar,
        {'topic': 'LaserScan'},
        takes=lambda reader: not is_cloud(reader),
    ),
    SensorKind(CAMERA_TYPES, read_camera, Camera, {**_IMAGES, **_LENSES}),
    SensorKind(LIDAR_TYPES, read_cloud, PointLidar, _CLOUDS, takes=is_cloud),
]
# Topics of the other parts of a run: DDS refuses a second type.
TAKEN = (
    *('clock', 'cmd_vel', 'cmd_vel_out', 'cmd_vel_smoothed', 'diagnostics', 'driver', 'e_stop'),
    *('elevation', 'foot_contacts', 'global_costmap/costmap', 'goal_pose', 'ground_truth/odom'),
    *('height_scan', 'imu/data', 'initialpose', 'joint_commands', 'joint_states', 'joy'),
    *('joy_priority', 'joy_vel', 'keepout_filter_mask', 'key_vel', 'keys', 'local_plan', 'map'),
    *('map_metadata', 'nav_vel', 'odom', 'odom_error', 'parameter_events', 'pause_navigation'),
    *('plan', 'pose', 'robot_description', 'rosout', 'selected', 'state', 'stop_closing_loop'),
    *('tab_vel', 'tf', 'tf_static', 'twist_marker', 'wheel_slip'),
)


class SensorTags(NamedTuple):
    """The tags of a description for each row of SENSORS, and in words what is not simulated."""

    kinds: list[list[SensorTag]]
    notes: list[str]


def read_sensor_tags(robot: Robot) -> SensorTags:
    """
    Return the sensors of a robot; those of kinds that have no row are left to others.

    A sensor whose tag is broken is left out, which a note says. Topics are relative, so that a
    namespace prefixes them; what ROS does not allow in a name becomes `_`. Where two sensors would
    publish one topic, both get their sensor's name before it. So does one whose topic is TAKEN.
    """
    found = SensorTags([[] for _ in SENSORS], [])
    for gazebo in robot.gazebo:
        link = gazebo.get('reference', '')
        for tag in gazebo.findall('sensor'):
            reader = TagReader(tag, link, found.notes)
            why = _why_left_out(reader, robot)
            if why:
                found.notes.append(f'sensor {reader.name!r} {why}: left out')
                continue
            for kind, tags in zip(SENSORS, found.kinds, strict=True):
                if reader.kind in kind.types and kind.takes(reader):
                    tags.append(kind.read(reader))
    pairs = list(zip(found.kinds, SENSORS, strict=True))
    named = [getattr(tag, name) for tags, kind in pairs for tag in tags for name in kind.topics]
    taken = [*TAKEN, *named]
    return found._replace(kinds=[_separate(tags, kind.topics, taken) for tags, kind in pairs])


def _why_left_out(reader: TagReader, robot: Robot) -> str:
    """Return why a sensor is not simulated, in words after its name; says what is exchanged."""
    if not any(reader.kind in kind.types for kind in SENSORS):
        is_known = reader.kind in sensor_tags.OTHER_TYPES
        return '' if is_known else f'has the type {reader.kind!r}, which Gazebo does not know'
    if reader.link not in robot.links:
        return f'is on {reader.link!r}, which is no link'
    find = reader.tag.findtext
    if wrong := sensor_tags.why_broken(reader.kind, find):
        return f'is broken, {wrong}'
    for line in sensor_tags.exchanged(reader.kind, find):
        reader.notes.append(f'sensor {reader.name!r}: {line}: swapped')
    return ''


def has_camera(robot: Robot) -> bool:
    """Return whether a robot needs others, and itself, to be there to be looked at."""
    tags = (tag for gazebo in robot.gazebo for tag in gazebo.findall('sensor'))
    return any(tag.get('type') in CAMERA_TYPES for tag in tags)


def _separate(
    tags: Sequence[SensorTag], names: Collection[str], topics: Sequence[str]
) -> list[SensorTag]:
    """Put the sensor's name before its topics where one, by field names, is twice in `topics`."""
    separate = []
    for tag in tags:
        used = {name: getattr(tag, name) for name in names if getattr(tag, name)}
        if any(topics.count(topic) > 1 for topic in used.values()):
            used = {name: legal_topic(f'{tag.name}/{topic}') for name, topic in used.items()}
        separate.append(replace(tag, **used))
    return separate
