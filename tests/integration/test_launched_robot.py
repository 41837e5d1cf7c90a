# SPDX-License-Identifier: Apache-2.0
"""What mbot.launch.py starts, started: one robot in a namespace, with a time of its own."""

from collections.abc import Iterator
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


@pytest.fixture
def launched(
    launch_file: Any, isolated_ros: int, tmp_path: Path
) -> Iterator[list['subprocess.Popen[str]']]:
    """Start the nodes of mbot.launch.py with the command lines that launch would give them."""
    nodes = launch_file(ROOT / 'wasd_bringup/launch/mbot.launch.py').start(
        namespace='mbot', keys='none', speed='3'
    )
    processes = [
        node.process(tmp_path, env=dict(os.environ), stderr=subprocess.PIPE, text=True)
        for node in nodes
    ]
    yield processes
    for process in processes:
        process.kill()
        process.wait()


def test_a_launched_robot_drives_in_its_namespace_and_ends_cleanly(
    launched: list['subprocess.Popen[str]'], spawn: Any, spin_until: Any
) -> None:
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
