# SPDX-License-Identifier: Apache-2.0
"""What mbot_nav.launch.py starts, started: the robot maps, and drives to a goal by the mux."""

from collections.abc import Iterator
import os
from pathlib import Path
import signal
import subprocess
from typing import Any

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid, Odometry
import pytest
from rclpy.node import Node
from terminals import PATIENCE
from wasd_core.topics import LATCHED

pytestmark = pytest.mark.slow

pytest.importorskip('tf2_msgs', reason='no tf2_msgs: python -m robot_description.build_interfaces')

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def launched(
    launch_file: Any, isolated_ros: int, tmp_path: Path
) -> Iterator[list['subprocess.Popen[str]']]:
    """Start the nodes of mbot_nav.launch.py with the command lines that launch would give them."""
    nodes = launch_file(ROOT / 'wasd_bringup/launch/mbot_nav.launch.py').start(
        keys='none', world='room'
    )
    processes = [
        node.process(tmp_path, env=dict(os.environ), stderr=subprocess.PIPE, text=True)
        for node in nodes
    ]
    yield processes
    for process in processes:
        process.kill()
        process.wait()


def test_a_launched_robot_maps_and_drives_to_a_goal(
    launched: list['subprocess.Popen[str]'], spawn: Any, spin_until: Any
) -> None:
    peer = spawn(Node('peer'))
    places: list[float] = []
    maps: list[Any] = []
    peer.create_subscription(Odometry, 'odom', lambda m: places.append(m.pose.pose.position.x), 10)
    peer.create_subscription(OccupancyGrid, 'map', maps.append, LATCHED)
    goals = peer.create_publisher(PoseStamped, 'goal_pose', 10)
    goal = PoseStamped()
    goal.header.frame_id = 'map'
    goal.pose.position.x, goal.pose.orientation.w = 1.0, 1.0

    def look() -> None:
        dead = [process.stderr.read() for process in launched if process.poll() is not None]
        assert not dead
        spawn.pump.handle(0.05)

    def ask() -> None:
        # Again, for a machine that is too busy: a node that was paused forgets its goal.
        if len(places) % 50 == 1:
            goals.publish(goal)
        look()

    # The first start ever compiles the navigator.
    spin_until(spawn.pump, lambda: maps and places, timeout=240.0, step=look)
    spin_until(spawn.pump, lambda: places[-1] > 0.05, step=ask)
    for process in launched:
        process.send_signal(signal.SIGINT)
    for process in launched:
        _, errors = process.communicate(timeout=PATIENCE)
        assert (process.returncode, 'Traceback' in errors) == (0, False), errors
