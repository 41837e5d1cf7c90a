# SPDX-License-Identifier: Apache-2.0
"""The example controllers of docs/ do what their pages say."""

from collections.abc import Callable, Iterator
import os
from pathlib import Path
import signal
import subprocess
import sys
from typing import Any

from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.node import Node
from terminals import PATIENCE

EXAMPLES = Path(__file__).resolve().parents[2] / 'docs/examples'


@pytest.fixture
def start(isolated_ros: int) -> Iterator[Callable[..., 'subprocess.Popen[str]']]:
    """Return a function that starts Python with arguments and ends it after the test."""
    started: list[subprocess.Popen[str]] = []

    def start_python(*arguments: str) -> 'subprocess.Popen[str]':
        command = [sys.executable, *arguments]
        started.append(
            subprocess.Popen(command, env=dict(os.environ), stderr=subprocess.PIPE, text=True)
        )
        return started[-1]

    yield start_python
    for process in started:
        process.kill()
        process.wait()


@pytest.mark.slow
def test_the_example_controller_stands_the_dog_up_over_joint_commands(
    start: Callable[..., Any], spawn: Any, spin_until: Any
) -> None:
    options = ('description:=go2', 'state_rate:=200.0', 'speed:=2.0')
    words = [word for option in options for word in ('-p', option)]
    start('-m', 'mujoco_sim.simulator_node', '--ros-args', *words)
    truth: list[Odometry] = []
    peer = spawn(Node('peer'))
    peer.create_subscription(Odometry, 'ground_truth/odom', truth.append, 1000)

    def heights() -> np.ndarray:
        return np.array([message.pose.pose.position.z for message in truth])

    spin_until(spawn.pump, lambda: len(truth) > 1)
    assert heights()[0] < 0.2  # it lies
    example = start(str(EXAMPLES / 'stand_up.py'))
    # It stands for half a second, at the height that its joint angles make.
    spin_until(
        spawn.pump,
        lambda: len(truth) > 100 and bool(np.all(abs(heights()[-100:] - 0.31) < 0.03)),
        timeout=PATIENCE,
    )
    assert np.ptp(heights()[-50:]) < 0.005
    example.send_signal(signal.SIGINT)
    _, errors = example.communicate(timeout=PATIENCE)
    assert 'Traceback' not in errors
