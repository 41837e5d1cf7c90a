# SPDX-License-Identifier: Apache-2.0
"""A robot that is driven from the page stops when the page is gone, whatever became of it."""

import bisect
from collections.abc import Callable, Iterator
import contextlib
import json
import math
from pathlib import Path
import re
import signal
import subprocess
import sys
import threading
import time
from typing import Any
import urllib.request

from geometry_msgs.msg import Twist
import page_puppet
from page_puppet import PagePuppet
import programs
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from terminals import PATIENCE

pytestmark = pytest.mark.slow

# A robot stands so soon after its page is gone [s].
STOP_TIME = 1.0
WAYS = ('killed', 'frozen', 'silent')


class Robot:
    """
    What is heard of a robot: its simulated time, the velocities it is commanded.

    Each with the time at which it was sent [ns]: on a busy machine it is heard late, not sent.
    """

    def __init__(self, domain: int) -> None:
        self.clock = [(0, 0.0)]
        self.commands: list[tuple[int, Twist]] = []
        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context, domain_id=domain)
        self._node = rclpy.create_node('listener', context=self._context)
        self._node.create_subscription(Clock, 'clock', self._on_clock, 1000)
        self._node.create_subscription(Twist, 'cmd_vel', self._on_twist, 1000)
        self._keys = self._node.create_publisher(String, 'keys', 10)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._executor.spin)
        self._thread.start()

    def close(self) -> None:
        """Hear no more."""
        self._executor.shutdown()
        self._thread.join()
        self._node.destroy_node()
        self._context.try_shutdown()

    @property
    def time(self) -> float:
        """The simulated time that was heard last [s]."""
        return self.clock[-1][1]

    def time_at(self, sent: int) -> float:
        """Return the simulated time that was sent last at a time [ns]."""
        return self.clock[bisect.bisect(self.clock, (sent, math.inf)) - 1][1]

    def wait(self, seconds: float) -> None:
        """Wait for simulated time to pass."""
        end = self.time + seconds
        self.wait_until(lambda: self.time >= end, f'{seconds} s of simulated time')

    def wait_until(self, condition: Callable[[], bool], what: str) -> None:
        """Wait for a condition, long enough for a busy machine."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, what
            time.sleep(0.01)

    def moves(self) -> bool:
        """Whether the last command is not zero."""
        return bool(self.commands) and not is_zero(self.commands[-1][1])

    def last_moved(self) -> float:
        """Return the simulated time of the last command that was not zero [s]."""
        return self.time_at(max(at for at, twist in self.commands if not is_zero(twist)))

    def press(self, key: str) -> None:
        """Press a key as another program does."""
        self.wait_until(self._keys.get_subscription_count, 'nobody listens to keys')
        self._keys.publish(String(data=key))

    def _on_clock(self, message: Clock, info: dict[str, int]) -> None:
        time = message.clock.sec + 1e-9 * message.clock.nanosec
        self.clock.append((info['source_timestamp'], time))

    def _on_twist(self, message: Twist, info: dict[str, int]) -> None:
        self.commands.append((info['source_timestamp'], message))


def is_zero(twist: Twist) -> bool:
    """Whether a command is to stand."""
    return twist == Twist()


@pytest.fixture
def robot(environment: dict[str, str]) -> Iterator[Robot]:
    """Return what is heard of the robot of the run."""
    robot = Robot(int(environment['ROS_DOMAIN_ID']))
    yield robot
    robot.close()


@pytest.fixture
def client(environment: dict[str, str]) -> Iterator[Callable[..., Any]]:
    """Return a function that starts a page in a process of its own, holding keys."""
    started: list[subprocess.Popen[str]] = []

    def start(url: str, *keys: str) -> 'subprocess.Popen[str]':
        program = (sys.executable, '-m', 'page_puppet', url, '50', *keys)
        folder = Path(page_puppet.__file__).parent
        started.append(
            programs.start(
                program, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
            )
        )
        assert started[-1].stdout is not None
        assert started[-1].stdout.readline() == 'holding\n'
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.wait()


def lose(way: str, url: str, client: Callable[..., Any], robot: Robot) -> contextlib.ExitStack:
    """Hold i on a page until the robot drives, then lose the page; return what is left of it."""
    left = contextlib.ExitStack()
    before = len(robot.commands)

    def has_moved() -> bool:  # a page that is starved meanwhile is lost, and rightly so
        return not all(is_zero(twist) for _, twist in robot.commands[before:])

    if way == 'silent':
        page = left.enter_context(PagePuppet(url))
        page.draw()
        page.keys = {page_puppet.code('I')}
        robot.wait_until(has_moved, 'driving')
        page.is_silent = True
        return left
    process = client(url, 'I')
    robot.wait_until(has_moved, 'driving')
    process.send_signal(signal.SIGKILL if way == 'killed' else signal.SIGSTOP)
    left.callback(process.kill)
    return left


def test_a_key_that_is_held_ends_with_its_page(
    run_with_page: Callable[..., Any], robot: Robot, client: Callable[..., Any]
) -> None:
    run = run_with_page('mbot')

    def lose_and_stop(way: str) -> float:
        with lose(way, run.url, client, robot):
            lost_at = time.time_ns()
            robot.wait(STOP_TIME + 0.2)
        # Opened again with no key down: nothing moves.
        with PagePuppet(run.url):
            robot.wait(0.3)
        assert is_zero(robot.commands[-1][1])
        return robot.last_moved() - robot.time_at(lost_at)

    for way in WAYS:
        assert lose_and_stop(way) <= STOP_TIME, way


def time_on(url: str) -> float:
    """Return the simulated time on a page without panels [s]."""
    with urllib.request.urlopen(f'{url}status', timeout=PATIENCE) as page:
        found = re.search(rb'^(\d+\.\d) s ', page.read(), re.M)
    return float(found[1]) if found else 0.0


def test_sticks_of_the_page_are_one_step_a_tap_and_end_with_it(
    run_with_page: Callable[..., Any], tmp_path: Path
) -> None:
    saves = ('--report', 'report.json', '--save-keys', 'keys.txt')
    run = run_with_page('go2', '--no-ros', *saves)

    def wait(seconds: float) -> None:
        end, deadline = time_on(run.url) + seconds, time.monotonic() + PATIENCE
        while time_on(run.url) < end:
            assert time.monotonic() < deadline, f'{seconds} s of simulated time'
            time.sleep(0.1)  # the page tells tenths

    # As slow as a browser without a graphics card on a busy machine.
    with PagePuppet(run.url, rate=5.0) as page:
        page.draw()
        page.tap('N2')
        wait(1.3)
        page.tap('N4')
        wait(0.3)
        for _ in range(4):
            page.tap('W')
        wait(0.3)
    wait(STOP_TIME + 0.2)
    # Open again, the page may hold what it likes: it was down when it came.
    again = PagePuppet(run.url)
    again.keys = {page_puppet.code('W')}
    with again:
        wait(0.5)
    wait(0.2)
    run.end()
    keys = [line.split() for line in (tmp_path / 'keys.txt').read_text().splitlines()]
    keys = [(float(at), key) for at, key in keys if '+' not in key]
    assert [key for _, key in keys][:7] == ['2', '4', 'w', 'w', 'w', 'w', 'SPACE']
    stopped_at = keys[6][0]
    samples = json.loads((tmp_path / 'report.json').read_text())['samples']
    forward = [command[0] for command in samples['command']]
    last = round(stopped_at / 0.02)
    # Four steps of 0.05 of the stick, whose end is 2 m/s.
    assert max(forward) == pytest.approx(4 * 0.05 * 2.0, abs=1e-6)
    assert max(map(abs, forward[last + round(STOP_TIME / 0.02) :])) == 0.0


def test_a_page_that_only_watches_does_not_stop_a_robot_that_others_drive(
    run_with_page: Callable[..., Any], robot: Robot
) -> None:
    run = run_with_page('mbot', '--preset', 'ramps')
    with PagePuppet(run.url) as page:
        page.draw()
        page.tap('P')  # no key of this preset
        robot.press('w')  # drives until another key
        robot.wait_until(robot.moves, 'driving')
    robot.wait(1.2)
    assert robot.moves()
    with PagePuppet(run.url) as page:
        page.draw()
        page.tap('W')
    robot.wait(STOP_TIME)
    assert not robot.moves()
