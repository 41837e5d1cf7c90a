# SPDX-License-Identifier: Apache-2.0
"""What a launch file starts, as processes: odometry and joints are told of the same instants."""

from collections.abc import Iterator
import os
from pathlib import Path
import signal
import subprocess
from typing import Any

import numpy as np
import pytest
from terminals import PATIENCE

pytest.importorskip('tf2_msgs', reason='no tf2_msgs: python -m robot_description.build_interfaces')
from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile
from tf2_msgs.msg import TFMessage

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
# So many transforms of odometry are looked at.
ENOUGH = 60


@pytest.fixture
def launched(launch_file: Any, tmp_path: Path, isolated_ros: int) -> Iterator[list[Any]]:
    """Start what mbot.launch.py starts, without a keyboard."""
    nodes = launch_file(ROOT / 'wasd_bringup/launch/mbot.launch.py').start(keys='none')
    options = {'env': dict(os.environ), 'stdin': subprocess.DEVNULL, 'start_new_session': True}
    processes = [node.process(tmp_path, **options) for node in nodes]
    yield processes
    for process in processes:
        process.send_signal(signal.SIGINT)
    for process in processes:
        process.wait(PATIENCE)


def test_the_wheels_are_told_of_the_instants_of_odometry(
    launched: list[Any], spawn: Any, spin_until: Any
) -> None:
    moving: list[TransformStamped] = []
    spawn(Node('observer')).create_subscription(
        TFMessage, '/tf', lambda m: moving.extend(m.transforms), QoSProfile(depth=1000)
    )

    def stamps(of_odometry: bool) -> list[int]:
        chosen = [t for t in list(moving) if (t.header.frame_id == 'odom') == of_odometry]
        return sorted({t.header.stamp.sec * 10**9 + t.header.stamp.nanosec for t in chosen})

    spin_until(
        spawn.pump,
        lambda: len(stamps(True)) > ENOUGH and len(stamps(False)) > ENOUGH,
        timeout=PATIENCE,
    )
    odometry, joints = stamps(True), stamps(False)
    first, last = max(odometry[0], joints[0]), min(odometry[-1], joints[-1])
    both = [[s for s in each if first <= s <= last] for each in (odometry, joints)]
    # A message that a busy machine loses moves an instant to the next one.
    common = len(set(both[0]) & set(both[1]))
    assert common >= 0.7 * len(both[0]), (common, len(both[0]), np.diff(both[0]), np.diff(both[1]))
    assert len(both[1]) <= 50 * 1e-9 * (last - first) + 2
