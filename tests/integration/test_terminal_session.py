# SPDX-License-Identifier: Apache-2.0
"""`wasd mbot` on a real pseudo-terminal: keys in, motion out, the terminal given back."""

from collections.abc import Callable, Iterator
import json
import os
from pathlib import Path
import pty
import select
import signal
import subprocess
import sys
import termios
import time
from typing import Any

from geometry_msgs.msg import Twist
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor

REPEAT_PERIOD = 1.0 / 30.0
WASD = ('-m', 'wasd_bringup.cli')
# The same command with a fault in the midst of the run.
FAULTY = """
import sys
from mujoco_sim.world import World
step = World.step
def faulty(self, count=1):
    if self.time > 8.0:
        raise RuntimeError('made for a test')
    step(self, count)
World.step = faulty
from wasd_bringup.cli import main
sys.exit(main(sys.argv[1:]))
"""


class Session:
    """A run of `wasd mbot` on its own pseudo-terminal, as a shell would start it."""

    def __init__(self, arguments: list[str], environment: dict[str, str], cwd: Path) -> None:
        self.master, self.slave = pty.openpty()
        self.before = termios.tcgetattr(self.slave)
        self.shown = ''
        self.process = subprocess.Popen(
            [sys.executable, *arguments, '--viewer', 'none'],
            stdin=self.slave,
            stdout=self.slave,
            stderr=self.slave,
            env={**environment, 'TERM': 'xterm'},
            cwd=cwd,
            preexec_fn=self._take_terminal,
        )

    def _take_terminal(self) -> None:
        os.setsid()
        import fcntl

        fcntl.ioctl(self.slave, termios.TIOCSCTTY, 0)

    def read(self, timeout: float = 0.0) -> None:
        """Take in what is on the screen."""
        while select.select([self.master], [], [], timeout)[0]:
            try:
                self.shown += os.read(self.master, 65536).decode(errors='replace')
            except OSError:
                return
            timeout = 0.0

    def wait_for(self, text: str, timeout: float = 20.0) -> None:
        """Wait until a text is shown."""
        deadline = time.monotonic() + timeout
        while text not in self.shown:
            assert time.monotonic() < deadline, f'{text!r} not in {self.shown!r}'
            self.read(0.05)

    def type(self, keys: str) -> None:
        """Type keys."""
        os.write(self.master, keys.encode())

    def hold(self, key: str, duration: float) -> float:
        """Hold a key for so long [s], repeating at 30 Hz; return the time from first to last."""
        first = last = time.monotonic()
        presses = round(duration / REPEAT_PERIOD)
        for press in range(presses):
            time.sleep(max(0.0, first + press * REPEAT_PERIOD - time.monotonic()))
            last = time.monotonic()
            self.type(key)
            self.read()
        return last - first

    def end(self, timeout: float = 10.0) -> int:
        """Wait for the end, reading on so that it can write; return the exit status."""
        deadline = time.monotonic() + timeout
        while self.process.poll() is None:
            assert time.monotonic() < deadline, self.shown
            self.read(0.05)
        self.read()
        return self.process.returncode

    def close(self) -> None:
        """Release the terminal, whatever happened."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        os.close(self.master)
        os.close(self.slave)


@pytest.fixture
def start(environment: dict[str, str], tmp_path: Path) -> Iterator[Callable[..., Session]]:
    """Return a function that starts a session; all are ended after the test."""
    sessions: list[Session] = []

    def begin(*arguments: str, program: tuple[str, ...] = WASD, robot: str = 'mbot') -> Session:
        sessions.append(Session([*program, robot, *arguments], environment, tmp_path))
        return sessions[-1]

    yield begin
    for session in sessions:
        session.close()


@pytest.fixture
def commands(environment: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Yield a function that returns all cmd_vel messages of the session so far."""
    for name in ('ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_LOG_DIR'):
        monkeypatch.setenv(name, environment[name])
    context = rclpy.Context()
    rclpy.init(args=[], context=context)
    node = rclpy.create_node('observer', context=context)
    seen: list[Twist] = []

    def wait_for_publisher() -> None:
        deadline = time.monotonic() + 20.0
        while node.count_publishers('cmd_vel') == 0:
            assert time.monotonic() < deadline, 'no publisher of cmd_vel'
            executor.spin_once(timeout_sec=0.1)

    node.create_subscription(Twist, 'cmd_vel', seen.append, 100)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def collect(duration: float) -> list[Twist]:
        if not seen:
            wait_for_publisher()
        deadline = time.monotonic() + duration
        while time.monotonic() < deadline:
            executor.spin_once(timeout_sec=0.02)
        return seen

    yield collect
    node.destroy_node()
    context.try_shutdown()


def hold_until_it_drives(session: Session, commands: Any) -> None:
    """Hold i until the command to drive has been seen from outside."""
    deadline = time.monotonic() + 20.0
    seen: list[Twist] = []
    while not (seen and seen[-1].linear.x > 0.0):
        assert time.monotonic() < deadline, session.shown
        session.hold('i', 0.4)
        print(session.process.poll(), session.shown[-300:])
        seen = commands(0.05)


@pytest.mark.slow
def test_holding_i_rolls_mbot_as_far_as_the_ramp_law_says(
    start: Callable[..., Session], tmp_path: Path
) -> None:
    session = start('--report', 'report.json')
    session.wait_for('Ctrl-C quit')
    session.wait_for('stopped')
    held = session.hold('i', 3.0)
    session.read(0.1)
    time.sleep(1.5)
    session.type('\x03')
    assert session.end() == 0
    report = json.loads((tmp_path / 'report.json').read_text())
    x, y, _ = report['samples']['position'][-1]
    # Equal ramps: speed x (hold + release delay), the delay being 0.12 s after the last press.
    assert x == pytest.approx(0.2 * (held + 0.12), rel=0.03)
    assert abs(y) < 0.001
    commanded = sum(command[0] * 0.02 for command in report['samples']['command'])
    assert x == pytest.approx(commanded, rel=0.03)
    assert report['samples']['velocity'][-1][0] == pytest.approx(0.0, abs=1e-6)


def test_it_shows_the_keys_and_a_status_line(start: Callable[..., Session]) -> None:
    session = start()
    session.wait_for('drive with i , j l')
    session.wait_for('full 0.20 m/s')
    session.type('q')
    session.wait_for('full 0.22 m/s')
    session.type('?')
    session.wait_for('Control mbot!')


def test_tab_goes_from_robot_to_robot_and_the_status_line_says_to_which(
    start: Callable[..., Session],
) -> None:
    session = start(robot='both')
    session.wait_for('TAB goes to the next robot')
    session.wait_for('[go2]')
    session.type('\t')
    session.wait_for('[mbot]')
    session.type('i')
    session.wait_for('driving')
    session.type('\x03')
    assert session.end() == 0


@pytest.mark.parametrize(
    ('number', 'status'),
    [(signal.SIGINT, 0), (signal.SIGTERM, 128 + 15), (signal.SIGHUP, 128 + 1)],
)
def test_a_signal_leaves_the_terminal_as_it_was_and_the_robot_stopped(
    start: Callable[..., Session], commands: Any, number: signal.Signals, status: int
) -> None:
    session = start()
    session.wait_for('stopped')
    assert termios.tcgetattr(session.slave) != session.before
    hold_until_it_drives(session, commands)
    session.process.send_signal(number)
    assert session.end() == status
    assert termios.tcgetattr(session.slave) == session.before
    last = commands(0.3)[-1]
    assert (last.linear.x, last.angular.z) == (0.0, 0.0)
    assert 'Traceback' not in session.shown


def test_ctrl_c_on_the_keyboard_is_the_normal_way_out(start: Callable[..., Session]) -> None:
    session = start('--report', 'report.json')
    session.wait_for('stopped')
    session.type('\x03')
    assert session.end() == 0
    assert termios.tcgetattr(session.slave) == session.before
    assert 'report in report.json' in session.shown


def test_an_exception_leaves_the_terminal_as_it_was_and_the_robot_stopped(
    start: Callable[..., Session], commands: Any, tmp_path: Path
) -> None:
    session = start('--report', 'report.json', program=('-c', FAULTY))
    session.wait_for('stopped')
    hold_until_it_drives(session, commands)
    assert session.end(20.0) == 1
    assert 'made for a test' in session.shown
    assert termios.tcgetattr(session.slave) == session.before
    last = commands(0.3)[-1]
    assert (last.linear.x, last.angular.z) == (0.0, 0.0)
    assert json.loads((tmp_path / 'report.json').read_text())['samples']['t'][-1] >= 7.9


def test_a_closed_terminal_ends_the_run(start: Callable[..., Session]) -> None:
    session = start()
    session.wait_for('stopped')
    os.close(session.master)
    session.master = os.dup(session.slave)
    assert session.process.wait(10.0) in (128 + 1, -1)
