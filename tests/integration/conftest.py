# SPDX-License-Identifier: Apache-2.0
"""Whole runs of the command, each in a process and a ROS domain of its own."""

from collections.abc import Callable, Iterator
import importlib
import json
import os
from pathlib import Path
import pty
import re
import select
import subprocess
import sys
import termios
import time
from typing import Any

from geometry_msgs.msg import Twist
import numpy as np
import programs
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from terminals import fill, PATIENCE

REPEAT_PERIOD = 1.0 / 30.0
WASD = (sys.executable, '-m', 'wasd_bringup.cli')
BENCHMARKS = Path(__file__).parents[2] / 'benchmarks'


@pytest.fixture(scope='module')
def bench() -> Iterator[Any]:
    """Return a function: a module of the benchmark by its name."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        yield importlib.import_module


def private_environment(folder: Path, domain: int) -> dict[str, str]:
    """Return an environment that no other ROS program on this machine shares."""
    return {
        **os.environ,
        'ROS_DOMAIN_ID': str(domain),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_LOG_DIR': str(folder / 'log'),
    }


class Runner:
    """Runs `wasd` in a folder, without a terminal; `said` is the last run's standard error."""

    def __init__(self, folder: Path, environment: dict[str, str]) -> None:
        self.folder = folder
        self.said = ''
        self.environment = environment

    def __call__(self, *arguments: str, **options: Any) -> 'subprocess.CompletedProcess[str]':
        """
        Run with arguments and capture what is printed.

        With options, and what looks at other processes, runs in a process of its own.
        """
        timeout = options.pop('timeout', 120)
        is_alone = arguments[:1] not in (('go2',), ('mbot',), ('both',), ('replay',))
        if options or is_alone or 'PYTHONHASHSEED' in self.environment:
            done = programs.run(
                [*WASD, *arguments],
                env=self.environment,
                cwd=self.folder,
                text=True,
                start_new_session=True,
                timeout=timeout,
                **{'stdin': subprocess.DEVNULL, **options},
            )
        else:
            done = programs.run_wasd(arguments, self.folder, self.environment)
        self.said = done.stderr
        return done

    def anew(self) -> 'Runner':
        """Return a Runner whose runs share nothing, not even the order of sets."""
        return Runner(self.folder, {**self.environment, 'PYTHONHASHSEED': 'random'})

    def start(self, *arguments: str, **options: Any) -> 'subprocess.Popen[str]':
        """Start with arguments and do not wait; nothing is captured unless asked for."""
        return programs.start(
            [*WASD, *arguments],
            env=self.environment,
            cwd=self.folder,
            text=True,
            start_new_session=True,
            **{
                'stdin': subprocess.DEVNULL,
                'stdout': subprocess.DEVNULL,
                'stderr': subprocess.DEVNULL,
                **options,
            },
        )

    def report(
        self,
        robot: str,
        *arguments: str,
        play: str | None = None,
        twist: str | None = None,
        speed: str = '0',
    ) -> dict[str, Any]:
        """Run a robot on scripts given as text; return its report."""
        words = [robot, '--speed', speed, '--report', 'report.json', *arguments]
        for option, text in (('--play', play), ('--twist', twist)):
            if text is not None:
                (self.folder / f'{option[2:]}.txt').write_text(text)
                words += [option, f'{option[2:]}.txt']
        done = self(*words, timeout=240)
        assert done.returncode == 0, done.stderr
        report: dict[str, Any] = json.loads((self.folder / 'report.json').read_text())
        return report


@pytest.fixture
def environment(tmp_path: Path, ros_domains: Iterator[int]) -> dict[str, str]:
    """Return an environment that no other ROS program on this machine shares."""
    return private_environment(tmp_path, next(ros_domains))


@pytest.fixture
def wasd(environment: dict[str, str], tmp_path: Path) -> Runner:
    """Return a function that runs `wasd` with arguments, without a terminal, and captures it."""
    return Runner(tmp_path, environment)


@pytest.fixture(scope='session')
def new_runner(
    tmp_path_factory: pytest.TempPathFactory, ros_domains: Iterator[int]
) -> Callable[..., Runner]:
    """
    Return a function that makes a Runner, for runs that several tests look at.

    It takes the ROS domain to run in; without, the Runner has one of its own.
    """

    def make(domain: int | None = None) -> Runner:
        folder = tmp_path_factory.mktemp('run')
        chosen = domain or next(ros_domains)
        return Runner(folder, private_environment(folder, chosen))

    return make


@pytest.fixture
def report_of(wasd: Runner) -> Callable[..., dict[str, Any]]:
    """Return a function that runs `wasd mbot` on a script and returns its report."""
    return lambda *arguments, **scripts: wasd.report('mbot', *arguments, **scripts)


class Page:
    """A run of `wasd` with its page."""

    def __init__(self, process: 'subprocess.Popen[str]', url: str) -> None:
        self.process = process
        self.url = url
        self.port = int(url.rsplit(':', 1)[1].strip('/'))

    def end(self) -> None:
        """End the run."""
        self.process.terminate()
        self.process.wait(PATIENCE)


@pytest.fixture
def run_with_page(environment: dict[str, str], tmp_path: Path) -> Iterator[Callable[..., Page]]:
    """Return a function that starts `wasd ROBOT --viewer web` and waits for its page."""
    pages: list[Page] = []

    def start(robot: str, *arguments: str, stdin: int = subprocess.DEVNULL) -> Page:
        process = programs.start(
            [*WASD, robot, '--viewer', 'web', *arguments],
            env=environment,
            cwd=tmp_path,
            text=True,
            stdin=stdin,
            stdout=subprocess.PIPE,
            start_new_session=True,
        )
        assert process.stdout is not None
        first = process.stdout.readline()
        found = re.fullmatch(r'viewer: (http://127\.0\.0\.1:\d+/)\n', first)
        assert found, first
        pages.append(Page(process, found[1]))
        return pages[-1]

    yield start
    for page in pages:
        page.end()


@pytest.fixture
def browser() -> Iterator[Any]:
    """Yield a headless Chromium that renders in software: few pixels, each costs."""
    pytest.importorskip('selenium.webdriver', reason='selenium is not installed')
    # Here, because it loads selenium.
    from page_in_browser import chromium

    try:
        driver = chromium(420, 320)
    except LookupError as error:
        pytest.skip(str(error))
    yield driver
    driver.quit()


@pytest.fixture
def picture(browser: Any) -> Callable[[], np.ndarray]:
    """Return a function that takes a screenshot, shape (height, width, 3)."""
    from page_in_browser import screenshot

    return lambda: screenshot(browser)


class TerminalSession:
    """A run of `wasd mbot` on its own pseudo-terminal, as a shell would start it."""

    def __init__(
        self,
        arguments: list[str],
        environment: dict[str, str],
        cwd: Path,
        last: tuple[str, ...] = ('--viewer', 'none'),
        size: tuple[int, int] | None = None,
    ) -> None:
        self.master, self.slave = pty.openpty()
        if size is not None:
            termios.tcsetwinsize(self.slave, size)
            # Workers of the tests have a size of their own in these.
            environment = {**environment, 'LINES': str(size[0]), 'COLUMNS': str(size[1])}
        self.before = termios.tcgetattr(self.slave)
        self.shown = ''
        self.process = programs.start(
            [*programs.ON_TERMINAL, *arguments, *last],
            stdin=self.slave,
            stdout=self.slave,
            stderr=self.slave,
            env={**environment, 'TERM': 'xterm'},
            cwd=cwd,
        )

    def read(self, timeout: float = 0.0) -> None:
        """Take in what is on the screen."""
        while select.select([self.master], [], [], timeout)[0]:
            try:
                self.shown += os.read(self.master, 65536).decode(errors='replace')
            except OSError:
                return
            timeout = 0.0

    def wait_for(self, text: str, timeout: float = PATIENCE) -> None:
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

    def freeze(self) -> None:
        """Leave no room on the screen for another byte; `read` would make room again."""
        fill(self.slave)

    def end(self, timeout: float = PATIENCE) -> int:
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
def start(environment: dict[str, str], tmp_path: Path) -> Iterator[Callable[..., TerminalSession]]:
    """Return a function that starts a session; all are ended after the test."""
    sessions: list[TerminalSession] = []

    def begin(
        *arguments: str, program: tuple[str, ...] = WASD[1:], robot: str = 'mbot'
    ) -> TerminalSession:
        sessions.append(TerminalSession([*program, robot, *arguments], environment, tmp_path))
        return sessions[-1]

    yield begin
    for session in sessions:
        session.close()


@pytest.fixture
def commands(environment: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """
    Yield a function that returns all cmd_vel messages of the session so far.

    Its list `sent` has them with the times at which they were sent [s].
    """
    for name in ('ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_LOG_DIR'):
        monkeypatch.setenv(name, environment[name])
    context = rclpy.Context()
    rclpy.init(args=[], context=context)
    node = rclpy.create_node('observer', context=context)
    seen: list[Twist] = []
    sent: list[tuple[float, Twist]] = []

    def hear(twist: Twist, info: dict[str, int]) -> None:
        seen.append(twist)
        sent.append((1e-9 * info['source_timestamp'], twist))

    def wait_for_publisher() -> None:
        deadline = time.monotonic() + PATIENCE
        while node.count_publishers('cmd_vel') == 0:
            assert time.monotonic() < deadline, 'no publisher of cmd_vel'
            executor.spin_once(timeout_sec=0.1)

    node.create_subscription(Twist, 'cmd_vel', hear, 1000)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def collect(duration: float) -> list[Twist]:
        if not seen:
            wait_for_publisher()
        deadline = time.monotonic() + duration
        while time.monotonic() < deadline:
            executor.spin_once(timeout_sec=0.02)
        return seen

    collect.sent = sent  # type: ignore[attr-defined]
    yield collect
    node.destroy_node()
    context.try_shutdown()


@pytest.fixture
def hold_until_it_drives() -> Callable[[TerminalSession, Any], None]:
    """Return a function that holds i until the command to drive has been seen from outside."""

    def hold(session: TerminalSession, commands: Any) -> None:
        deadline = time.monotonic() + PATIENCE
        seen: list[Twist] = []
        while not (seen and seen[-1].linear.x > 0.0):
            assert time.monotonic() < deadline, session.shown
            session.hold('i', 0.4)
            print(session.process.poll(), session.shown[-300:])
            seen = commands(0.05)

    return hold


@pytest.fixture
def run_on_terminal() -> Iterator[Callable[..., TerminalSession]]:
    """Return a function that starts any Python program on a pseudo-terminal of its own."""
    sessions: list[TerminalSession] = []

    def begin(
        arguments: list[str],
        environment: dict[str, str],
        folder: Path,
        size: tuple[int, int] | None = None,
    ) -> TerminalSession:
        sessions.append(TerminalSession(arguments, environment, folder, (), size))
        return sessions[-1]

    yield begin
    for session in sessions:
        session.close()
