# SPDX-License-Identifier: Apache-2.0
"""What mbot.launch.py starts, started: one robot in a namespace, with a time of its own."""

from collections.abc import Callable, Iterator
import importlib.util
import os
from pathlib import Path
import signal
import subprocess
from typing import Any

from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from terminals import PATIENCE

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
# So many transforms of odometry are looked at.
ENOUGH = 60


Launch = Callable[..., list['subprocess.Popen[str]']]


@pytest.fixture
def launch(launch_file: Any, isolated_ros: int, tmp_path: Path) -> Iterator[Launch]:
    """Return a function that starts mbot.launch.py's nodes with the command lines of launch."""
    processes: list[subprocess.Popen[str]] = []

    def start(**given: str) -> list['subprocess.Popen[str]']:
        nodes = launch_file(ROOT / 'wasd_bringup/launch/mbot.launch.py').start(**given)
        options = {'env': dict(os.environ), 'stderr': subprocess.PIPE, 'text': True}
        processes.extend(node.process(tmp_path, **options) for node in nodes)
        return processes

    yield start
    for process in processes:
        process.kill()
        process.wait()


def test_a_launched_robot_drives_in_its_namespace_and_ends_cleanly(
    launch: Launch, spawn: Any, spin_until: Any
) -> None:
    launched = launch(namespace='mbot', keys='none', speed='3')
    peer = spawn(Node('peer'))
    places: list[float] = []
    clock: list[Any] = []
    peer.create_subscription(Clock, '/mbot/clock', clock.append, 10)
    peer.create_subscription(
        Odometry, '/mbot/odom', lambda m: places.append(m.pose.pose.position.x), 10
    )
    driver = peer.create_publisher(Twist, '/mbot/cmd_vel', 10)
    forward = Twist()
    forward.linear.x = 0.5

    def drive() -> None:
        dead = [process.stderr.read() for process in launched if process.poll() is not None]
        assert not dead
        driver.publish(forward)
        spawn.pump.handle(0.05)

    spin_until(spawn.pump, lambda: clock and places and places[-1] > 0.1, step=drive)
    names = {name for name, _ in peer.get_topic_names_and_types()}
    assert not {'/clock', '/tf', '/tf_static', '/odom'} & names
    see_the_wheels_told_of_the_instants_of_odometry(spawn, spin_until)
    for process in launched:
        process.send_signal(signal.SIGINT)
    for process in launched:
        _, errors = process.communicate(timeout=PATIENCE)
        assert (process.returncode, 'Traceback' in errors) == (0, False), errors
    if importlib.util.find_spec('tf2_msgs') is None:
        pytest.skip('wheels not seen: no tf2_msgs: python -m robot_description.build_interfaces')


def see_the_wheels_told_of_the_instants_of_odometry(spawn: Any, spin_until: Any) -> None:
    if importlib.util.find_spec('tf2_msgs') is None:  # the extra is not installed
        return
    from tf2_msgs.msg import TFMessage

    moving: list[Any] = []
    observer = spawn(Node('observer'))
    observer.create_subscription(
        TFMessage, '/mbot/tf', lambda m: moving.extend(m.transforms), QoSProfile(depth=1000)
    )

    def stamps(of_odometry: bool) -> list[int]:
        chosen = [t for t in list(moving) if (t.header.frame_id == 'odom') == of_odometry]
        return sorted({t.header.stamp.sec * 10**9 + t.header.stamp.nanosec for t in chosen})

    spin_until(spawn.pump, lambda: min(len(stamps(True)), len(stamps(False))) > ENOUGH)
    odometry, joints = stamps(True), stamps(False)
    first, last = max(odometry[0], joints[0]), min(odometry[-1], joints[-1])
    both = [[s for s in each if first <= s <= last] for each in (odometry, joints)]
    # A message that a busy machine loses moves an instant to the next one.
    common = len(set(both[0]) & set(both[1]))
    assert common >= 0.7 * len(both[0]), (common, len(both[0]), np.diff(both[0]), np.diff(both[1]))
    assert len(both[1]) <= 50 * 1e-9 * (last - first) + 2


def test_without_physics_odometry_goes_by_wall_time(
    launch: Launch, spawn: Any, spin_until: Any
) -> None:
    launch(mode='fake', keys='none')
    odometry: list[Odometry] = []
    spawn(Node('peer')).create_subscription(Odometry, 'odom', odometry.append, 10)
    spin_until(spawn.pump, lambda: len(odometry) > 1)
