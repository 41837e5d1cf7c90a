# SPDX-License-Identifier: Apache-2.0
"""
Nodes that are started one by one, as docs/graph.md says, backward, and a Go2's also in its order.

Backward no node finds what it needs; the robot is driven all the same. In order the launch files
start mbot's: see test_launched_navigation.py and test_launched_robot.py.
"""

from collections.abc import Iterator
from importlib import import_module
import itertools
import os
from pathlib import Path
import re
import shlex
import subprocess
import sys
import textwrap
import time
from typing import NamedTuple

from executables import SCRIPTS
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
import programs
import pytest
from rclpy.node import Node
from std_msgs.msg import String
from terminals import PATIENCE
from wasd_core.topics import LATCHED

ROOT = Path(__file__).resolve().parents[2]
SECTION = (ROOT / 'docs/graph.md').read_text().split('## Node by node\n')[1].split('\n## ')[0]
BLOCKS = [
    tuple(textwrap.dedent(block).splitlines())
    for block in re.findall(r'(?:^    .*\n)+', SECTION, re.MULTILINE)
]
GO2_KEYS, GO2_TWIST, _, MBOT_MUX, MBOT_GOAL, MBOT_FAKE = BLOCKS
# Who reads a terminal.
KEYBOARDS = ('key_publisher', 'teleop')
# Of a program whose nodes have other names, the last.
NODES = {'teleop': 'robot_monitor'}
TILTED = 0.5  # [rad]

pytestmark = [pytest.mark.long, pytest.mark.slow]


def executable(line: str) -> tuple[str, str, list[str]]:
    """Return the executable that a line of the page starts, its target and its words."""
    run, package, name, *words = shlex.split(line.removeprefix('ros2 '))
    assert (run, SCRIPTS[name].partition('.')[0]) == ('run', package)
    return name, SCRIPTS[name], words


class Started(NamedTuple):
    """A process, and the terminal on which it can be typed, if it reads one."""

    process: subprocess.Popen[str]
    terminal: int | None


class Watcher(Node):
    """Sees the robot's state and where it is."""

    def __init__(self) -> None:
        super().__init__('watcher', start_parameter_services=False)
        self.state, self.place, self.tilt, self.has_truth = '', None, 0.0, False
        self.is_under_way, self.time = False, 0  # simulated [s]
        self.create_subscription(String, 'state', self._on_state, LATCHED)
        self.create_subscription(Twist, 'cmd_vel', self._on_velocity, 10)
        self.create_subscription(Odometry, 'odom', self._on_odometry, 10)
        self.create_subscription(Odometry, 'ground_truth/odom', self._on_truth, 10)

    def _on_state(self, message: String) -> None:
        self.state = message.data

    def _on_velocity(self, message: Twist) -> None:
        self.is_under_way = message.linear.x > 0.0

    def _on_odometry(self, message: Odometry) -> None:
        self.time = message.header.stamp.sec
        if not self.has_truth:
            self.place = message.pose.pose.position

    def _on_truth(self, message: Odometry) -> None:
        self.has_truth, self.place = True, message.pose.pose.position
        q = message.pose.pose.orientation
        # sin of half the angle between the base's z axis and the world's.
        self.tilt = max(self.tilt, 2.0 * (q.x**2 + q.y**2) ** 0.5)


class Bench:
    """The processes of a block, what they say, and who watches them."""

    def __init__(self, spawn, folder: Path) -> None:
        self._pump, self._folder = spawn.pump, folder
        self.watcher = spawn(Watcher())
        self.started: dict[str, Started] = {}

    def start(self, line: str) -> None:
        """Start what a line of the page starts, and wait until it is there."""
        name, target, words = executable(line)
        module, _, program = target.partition(':')
        words = [sys.executable, '-m', getattr(import_module(module), program).module, *words]
        master = slave = None
        if name in KEYBOARDS:
            master, slave = os.openpty()
        with (self._folder / name).open('wb') as said:
            process = programs.start(
                words,
                env=dict(os.environ),
                stdin=subprocess.DEVNULL if slave is None else slave,
                stdout=said,
                stderr=said,
                start_new_session=True,
            )
        if slave is not None:
            os.close(slave)
        self.started[name] = Started(process, master)
        node = NODES.get(name, name)
        self.until(lambda: node in self.watcher.get_node_names())

    def until(self, condition, step=lambda: None) -> None:
        """Handle messages until a condition holds, calling `step` ten times a second."""
        deadline, due = time.monotonic() + PATIENCE, 0.0
        while not condition():
            now = time.monotonic()
            assert now < deadline, self.said()
            assert all(each.process.poll() is None for each in self.started.values()), self.said()
            if now >= due:
                due = now + 0.1
                step()
            self._pump.handle(0.02)

    def type(self, name: str, text: str) -> None:
        """Type on a keyboard."""
        terminal = self.started[name].terminal
        assert terminal is not None
        os.write(terminal, text.encode())

    def press(self, key: str, state: str) -> None:
        """Press a key of the Go2 until its state is there: who listens may still be starting."""
        self.until(lambda: self.watcher.state == state, lambda: self.type('key_publisher', key))

    def said(self) -> str:
        """Return what all have said, and where the robot is."""
        texts = [f'{name}: {(self._folder / name).read_text()}' for name in self.started]
        return '\n'.join([*texts, f'{self.watcher.state} {self.watcher.place}'])

    def close(self) -> None:
        """End all."""
        for process, _ in self.started.values():
            process.terminate()
        for process, terminal in self.started.values():
            process.wait(PATIENCE)
            if terminal is not None:
                os.close(terminal)


@pytest.fixture(scope='module')
def compiled() -> None:
    """Have all compiled: an empty home's nodes take a minute of a processor, or more, for it."""
    for module in ('quadruped_sim', 'wasd_navigation'):
        subprocess.run([sys.executable, '-m', module], check=True, capture_output=True)


@pytest.fixture
def bench(spawn, tmp_path, compiled) -> Iterator[Bench]:
    bench = Bench(spawn, tmp_path)
    yield bench
    bench.close()


def assert_all_is_well(bench):
    """Check how the robot stood, and what was said."""
    assert bench.watcher.tilt < TILTED
    assert 'it does not move' not in bench.said()
    assert 'Traceback' not in bench.said()


def test_each_line_of_the_page_starts_an_executable_of_the_package_it_names():
    assert len(list(map(executable, itertools.chain(*BLOCKS)))) > 20


@pytest.mark.parametrize('is_backward', [False, True], ids=['in_order', 'backward'])
def test_a_go2_is_driven_by_keys_and_by_velocities_as_the_page_says(bench, is_backward):
    # The nodes of one block are those of the other, and one more; whose clock it is plays no part.
    clock = ' --ros-args -p use_sim_time:=true'
    assert GO2_TWIST[:-1] == tuple(line.removesuffix(clock) for line in GO2_KEYS)
    for line in reversed(GO2_TWIST) if is_backward else GO2_TWIST:
        bench.start(line)
    watcher = bench.watcher
    bench.until(lambda: watcher.place is not None)
    bench.press('2', 'fixed stand')
    bench.until(lambda: watcher.place.z > 0.33)
    left = 6  # presses, of which each moves the stick by a step

    def push():
        nonlocal left
        if left > 0:
            left -= 1
            bench.type('key_publisher', 'w')

    if is_backward:  # mbot's keys come so, too
        bench.press('4', 'trotting')
        bench.until(lambda: watcher.place.x > 0.1, push)
        bench.press('2', 'fixed stand')
    else:
        bench.press('5', 'move base')
        bench.until(lambda: watcher.place.x > 0.1, lambda: bench.type('key_publisher', 'i'))
    assert_all_is_well(bench)


@pytest.mark.parametrize('block', [MBOT_MUX, MBOT_GOAL, MBOT_FAKE], ids=['mux', 'goal', 'fake'])
def test_the_mbot_of_a_block_is_driven_as_the_page_says(bench, spawn, block):
    for line in reversed(block):
        bench.start(line)
    if 'navigator' in bench.started:
        drive_to_goal(bench, spawn)
    else:
        drive_wheels(bench)
    assert_all_is_well(bench)


def drive_wheels(bench):
    """Drive ahead by mbot's key i, which is held."""
    bench.until(lambda: bench.watcher.place is not None)
    start = bench.watcher.place
    (keyboard,) = bench.started.keys() & set(KEYBOARDS)
    bench.until(
        lambda: abs(bench.watcher.place.x - start.x) > 0.05, lambda: bench.type(keyboard, 'i')
    )


def drive_to_goal(bench, spawn):
    """Send a goal ahead until it is driven to: who takes it may still be starting."""
    sender = spawn(Node('sender', start_parameter_services=False))
    goals = sender.create_publisher(PoseStamped, 'goal_pose', 10)
    goal = PoseStamped()
    goal.header.frame_id, goal.pose.position.x, goal.pose.orientation.w = 'map', 0.6, 1.0

    due = 0

    def send():
        nonlocal due
        # A new goal ends the one before: a busy navigator needs the time to begin.
        if not bench.watcher.is_under_way and bench.watcher.time >= due:
            due = bench.watcher.time + 5
            goals.publish(goal)

    bench.until(lambda: bench.watcher.place is not None and bench.watcher.place.x > 0.05, send)
