# SPDX-License-Identifier: Apache-2.0
"""What mbot.launch.py starts, started: one robot in a namespace, with a time of its own."""

from collections.abc import Callable, Iterator
import os
from pathlib import Path
import signal
import subprocess
from typing import Any

from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
import pytest
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from terminals import PATIENCE

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]


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

    spin_until(spawn.pump, lambda: clock and places and places[-1] > 0.3, step=drive)
    names = {name for name, _ in peer.get_topic_names_and_types()}
    assert not {'/clock', '/tf', '/tf_static', '/odom'} & names
    for process in launched:
        process.send_signal(signal.SIGINT)
    for process in launched:
        _, errors = process.communicate(timeout=PATIENCE)
        assert (process.returncode, 'Traceback' in errors) == (0, False), errors


def test_without_physics_odometry_goes_by_wall_time(
    launch: Launch, spawn: Any, spin_until: Any
) -> None:
    launch(mode='fake', keys='none')
    odometry: list[Odometry] = []
    spawn(Node('peer')).create_subscription(Odometry, 'odom', odometry.append, 10)
    spin_until(spawn.pump, lambda: len(odometry) > 1)
