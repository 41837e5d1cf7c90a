# SPDX-License-Identifier: Apache-2.0
"""What a second process that joins late sees of each robot: one tree of frames, one time."""

from bisect import bisect_left
from collections.abc import Callable, Iterator
from functools import partial
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any

import numpy as np
import programs
import pytest
from terminals import PATIENCE

pytest.importorskip(
    'tf2_msgs',
    reason='no tf2_msgs: python -m robot_description.build_interfaces says what it needs',
)
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile
from robot_description.description import read_description
from robot_description.meshes.files import published_urdf
from robot_description.packages import description_path
from robot_description.urdf import parse_urdf
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Imu, LaserScan, PointCloud2
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage
from wasd_core.node import init_ros

pytestmark = pytest.mark.slow

KEYS = {'mbot': '0.1 i*300', 'go2': '0.1 2\n1 4\n1.5 w*4'}
BASE = {'mbot': 'base_footprint', 'go2': 'base'}
MEASURED = {
    'points': PointCloud2,
    'scan': LaserScan,
    'imu/data': Imu,
    'camera/camera_info': CameraInfo,
}
# How long the late one listens [simulated s], and how late it is at least [wall s].
LISTENED, LATE = 1.2, 0.5


def tick(stamp: Any) -> int:
    """Return a stamp as whole nanoseconds, so that equal means equal."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


class Observer:
    """Notes everything that a robot says, from this process."""

    def __init__(self) -> None:
        self.node = Node('observer')
        self.clock: list[int] = []
        self.moving: list[TransformStamped] = []
        self.fixed: list[TransformStamped] = []
        self.odometry: list[int] = []
        self.descriptions: list[str] = []
        self.measured: list[tuple[str, str, int]] = []  # topic, frame, stamp
        many = QoSProfile(depth=1000)
        latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for kind, topic, qos, take in (
            (Clock, '/clock', many, lambda m: self.clock.append(tick(m.clock))),
            (TFMessage, '/tf', many, lambda m: self.moving.extend(m.transforms)),
            (TFMessage, '/tf_static', latched, lambda m: self.fixed.extend(m.transforms)),
            (Odometry, 'odom', many, lambda m: self.odometry.append(tick(m.header.stamp))),
            (String, 'robot_description', latched, lambda m: self.descriptions.append(m.data)),
        ):
            self.node.create_subscription(kind, topic, take, qos)
        for topic, kind in MEASURED.items():
            take = partial(self._note, topic)
            self.node.create_subscription(kind, topic, take, qos_profile_sensor_data)

    def _note(self, topic: str, message: Any) -> None:
        self.measured.append((topic, message.header.frame_id, tick(message.header.stamp)))

    def listen(self, is_enough: Callable[[], bool], patience: float = PATIENCE) -> None:
        """Listen until it is enough."""
        end = time.monotonic() + patience
        while not is_enough():
            assert time.monotonic() < end, f'heard {len(self.clock)} times of /clock'
            rclpy.spin_once(self.node, timeout_sec=0.1)

    def odometry_stamps(self) -> list[int]:
        """Return the stamps of the transforms from odom."""
        return [tick(t.header.stamp) for t in self.moving if t.header.frame_id == 'odom']


@pytest.fixture(scope='module', params=['mbot', 'go2'])
def seen(
    request: Any, tmp_path_factory: pytest.TempPathFactory, ros_domains: Iterator[int]
) -> Iterator[tuple[str, Observer]]:
    """Run a robot in a process of its own and observe it from this one, late."""
    robot, folder = request.param, tmp_path_factory.mktemp('transforms')
    private = {
        'ROS_DOMAIN_ID': str(next(ros_domains)),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_LOG_DIR': str(folder),
    }
    with pytest.MonkeyPatch.context() as patch:
        for name, value in private.items():
            patch.setenv(name, value)
        process = start(robot, folder)
        init_ros([])
        try:
            first = Observer()
            first.listen(lambda: bool(first.clock))
            time.sleep(LATE)
            late = Observer()
            late.listen(
                lambda: bool(late.clock) and late.clock[-1] - late.clock[0] > LISTENED * 1e9
            )
            yield robot, late
        finally:
            rclpy.try_shutdown()
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, 'Traceback' in errors) == (0, False), errors


def start(robot: str, folder: Path) -> 'subprocess.Popen[str]':
    """Start a robot that is driven by keys."""
    script = folder / 'keys.txt'
    script.write_text(KEYS[robot])
    return programs.start(
        [sys.executable, '-m', 'wasd_bringup.cli', robot, '--play', str(script)]
        + ['--duration', '60'],  # until it has been heard for long enough
        env=dict(os.environ),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def test_late_joiners_get_the_description_and_the_fixed_frames(seen: tuple[str, Observer]) -> None:
    robot, observer = seen
    read = read_description(description_path(robot))
    assert observer.descriptions == [published_urdf(read.urdf, read.meshes.files)]
    joints = parse_urdf(observer.descriptions[0]).joints.values()
    fixed = {(joint.parent, joint.child) for joint in joints if joint.kind == 'fixed'}
    heard = [(t.header.frame_id, t.child_frame_id) for t in observer.fixed]
    assert sorted(heard) == sorted(fixed)


def test_all_frames_make_one_tree_with_one_root(seen: tuple[str, Observer]) -> None:
    robot, observer = seen
    edges = {(t.child_frame_id, t.header.frame_id) for t in (*observer.fixed, *observer.moving)}
    parents = dict(edges)
    assert len(parents) == len(edges)  # no frame has two parents
    links = parse_urdf(observer.descriptions[0]).links
    assert set(parents) == set(links)
    for frame in parents:
        path = [frame]
        while path[-1] in parents:
            path.append(parents[path[-1]])
            assert len(path) <= len(parents) + 1, f'a loop: {path}'
        assert path[-1] == 'odom'
    assert parents[BASE[robot]] == 'odom'


def test_transforms_are_stamped_with_the_time_of_clock(seen: tuple[str, Observer]) -> None:
    _, observer = seen
    instants = set(observer.clock)
    stamps = {tick(t.header.stamp) for t in observer.moving}
    heard = {stamp for stamp in stamps if observer.clock[0] <= stamp <= observer.clock[-1]}
    assert len(heard) > 0.8 * 50 * LISTENED
    assert heard <= instants


def test_odometry_comes_at_50_hz_with_one_stamp_for_message_and_transform(
    seen: tuple[str, Observer],
) -> None:
    _, observer = seen
    stamps = observer.odometry_stamps()
    assert len(stamps) > 0.8 * 50 * LISTENED
    assert set(np.diff(stamps)) == {20_000_000}
    common = [s for s in observer.odometry if stamps[0] <= s <= stamps[-1]]
    assert common == [s for s in stamps if common[0] <= s <= common[-1]]


def test_where_a_sensor_was_can_be_looked_up_for_each_of_its_messages(
    seen: tuple[str, Observer],
) -> None:
    robot, observer = seen
    parents = {t.child_frame_id: t.header.frame_id for t in (*observer.fixed, *observer.moving)}
    known: dict[str, list[int]] = {}
    for transform in observer.moving:
        known.setdefault(transform.child_frame_id, []).append(tick(transform.header.stamp))
    begin, end = max(s[0] for s in known.values()), min(s[-1] for s in known.values())
    asked = [each for each in observer.measured if begin <= each[2] <= end]
    topics = {'mbot': {'scan', 'camera/camera_info'}, 'go2': {'points', 'scan', 'imu/data'}}
    assert {topic for topic, _, _ in asked} == topics[robot]
    for topic, frame, stamp in asked:
        while frame != 'odom':
            assert frame in parents, f'{topic}: {frame}'
            if stamps := known.get(frame):
                after = bisect_left(stamps, stamp)
                assert after < len(stamps)
                assert stamps[after] == stamp or after > 0
            frame = parents[frame]
