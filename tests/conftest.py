# SPDX-License-Identifier: Apache-2.0
"""What all tests share: a ROS domain of one's own, rclpy in this process, waiting for something."""

from collections.abc import Callable, Iterator
import os
from pathlib import Path
import random
import time
from typing import Any

import pytest

# How long a message may take to arrive on a busy machine [s].
PATIENCE = 10.0

# Domains up to 101 have their ports below the ephemeral ones; 0 is everybody's.
_DOMAINS = range(1, 101)


@pytest.fixture(scope='session')
def log_directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder for what ROS nodes log, so that the user's home stays as it is."""
    return tmp_path_factory.mktemp('ros_log')


@pytest.fixture(autouse=True)
def isolated_ros(monkeypatch: pytest.MonkeyPatch, log_directory: Path) -> int:
    """Keep to a ROS domain that no other test and no robot nearby uses; return its number."""
    domain = random.SystemRandom().choice(_DOMAINS)
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    monkeypatch.setenv('ROS_LOG_DIR', str(log_directory))
    return domain


@pytest.fixture
def ros(isolated_ros: int) -> Iterator[None]:
    """Have rclpy initialised as the project's nodes do it, and shut down afterwards."""
    import rclpy
    from robot_description.node_support import init_ros

    init_ros([])
    yield
    rclpy.try_shutdown()


@pytest.fixture
def spin_until() -> Callable[..., None]:
    """Return `wait(pump, condition, timeout)`, see `_spin_until`."""
    return _spin_until


def _spin_until(
    pump: Any, condition: Callable[[], Any], timeout: float = PATIENCE, step: Any = None
) -> None:
    """
    Handle messages until a condition holds; fail after `timeout` [s].

    `pump` is a MessagePump, any other executor, or a callable that waits for messages up to the
    seconds it is given. `step` is called in between, e.g. to let a simulation run.
    """
    handle = getattr(pump, 'handle', None) or getattr(pump, 'spin_once', None) or pump
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline, f'nothing came in {timeout} s'
        if step is not None:
            step()
        handle(0.0 if step is not None else 0.02)


@pytest.fixture
def spawn(ros: None) -> Iterator[Callable[[Any], Any]]:
    """Return a function that puts nodes on one pump, `spawn.pump`; they are destroyed afterwards."""
    from robot_description.node_support import MessagePump

    pump = MessagePump()
    nodes: list[Any] = []

    def add(node: Any) -> Any:
        nodes.append(node)
        pump.add_node(node)
        return node

    add.pump = pump  # type: ignore[attr-defined]
    yield add
    pump.shutdown(timeout_sec=0.0)
    for node in nodes:
        node.destroy_node()


def pytest_configure(config: pytest.Config) -> None:
    """Keep nodes quiet about colours: captured output is compared as text."""
    os.environ.setdefault('RCUTILS_COLORIZED_OUTPUT', '0')
