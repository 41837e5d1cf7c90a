# SPDX-License-Identifier: Apache-2.0
"""What all tests share: a ROS domain of their own, rclpy in this process, waiting."""

from collections.abc import Callable, Iterator
import gc
import importlib.util
import itertools
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any

import expansions
import pytest
from terminals import PATIENCE
from wasd_core.shared_memory import FIRST_PORT, PORTS_OF_DOMAIN

pytest_plugins = ['hanging']

# Hundreds of processes start here, and each would compile the project anew.
os.environ.pop('PYTHONDONTWRITEBYTECODE', None)
sys.dont_write_bytecode = False
# ./wasd test says how it was called; programs that tests start were called by nobody.
os.environ.pop('WASD_CALLED', None)
# Nor shall they open pages on somebody's desktop.
for name in ('DISPLAY', 'WAYLAND_DISPLAY'):
    os.environ.pop(name, None)
# Tests compare what nodes say.
os.environ.setdefault('RCUTILS_COLORIZED_OUTPUT', '0')

# A shell starts what goes to the background deaf to these, nohup to the last, and children inherit
# that.
for number in (signal.SIGINT, signal.SIGQUIT, signal.SIGHUP):
    if signal.getsignal(number) is signal.SIG_IGN:
        is_interrupt = number == signal.SIGINT
        signal.signal(number, signal.default_int_handler if is_interrupt else signal.SIG_DFL)


@pytest.hookimpl(optionalhook=True)  # not every place that runs tests has xdist
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Return how many workers `-n auto` means: two more than processors, for tests wait, too."""
    return len(os.sched_getaffinity(0)) + 2


@pytest.hookimpl(tryfirst=True)  # before xdist starts its workers
def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile once what each of several workers would compile by itself after a change."""
    if session.config.getoption('numprocesses', None):
        words = [[sys.executable, '-m', name] for name in ('quadruped_sim', 'wasd_navigation')]
        # Who cannot compile says so in a test.
        silent = subprocess.DEVNULL
        for process in [subprocess.Popen(each, stdout=silent, stderr=silent) for each in words]:
            process.wait()


def pytest_collection() -> None:
    """Load all tests without looking for garbage, of which that makes next to none."""
    gc.disable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the files that take long: none is left to one worker at the end."""
    items.sort(key=lambda item: item.get_closest_marker('long') is None)


def pytest_collection_finish() -> None:
    """
    Collect garbage from here on, but not what is loaded: it stays till the end.

    And remember what descriptions expand to, see tests/expansions.py.
    """
    gc.freeze()
    gc.enable()
    expansions.remember()


# Domains up to 101 have their ports below the ephemeral ones; 0 is everybody's. Two test runs on
# one machine keep apart with a part each: WASD_TEST_DOMAINS=1-50 for one, 51-100 for the other.
_FIRST, _, _LAST = os.environ.get('WASD_TEST_DOMAINS', '1-100').partition('-')
_WORKER = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0').removeprefix('gw'))
_WORKERS = int(os.environ.get('PYTEST_XDIST_WORKER_COUNT', '1'))
# No two workers share one.
_DOMAINS = range(int(_FIRST) + _WORKER, int(_LAST or _FIRST) + 1, _WORKERS)


def _is_free(domain: int) -> bool:
    """Whether no participant on this machine is in a ROS domain: each has a port of it."""
    first = FIRST_PORT + PORTS_OF_DOMAIN * domain
    lines = Path('/proc/net/udp').read_text().splitlines()[1:]
    ports = (int(line.split()[1].rpartition(':')[2], 16) for line in lines)
    return not any(first <= port < first + PORTS_OF_DOMAIN for port in ports)


def _free_domains() -> Iterator[int]:
    """
    Yield this worker's domains in turn, but for those in which somebody still is.

    A node whose start has failed stays until its garbage is collected: in this process, or in the
    one that runs of `wasd` share.
    """
    if not _DOMAINS:
        raise pytest.UsageError(
            f'WASD_TEST_DOMAINS: wanted {_WORKERS} or more, one for each worker'
        )
    turn = itertools.cycle(_DOMAINS)
    while True:
        some = list(itertools.islice(turn, len(_DOMAINS)))
        yield from filter(_is_free, some) if any(map(_is_free, some)) else some


_next_domain = _free_domains()


@pytest.fixture(scope='session')
def ros_domains() -> Iterator[int]:
    """Return the ROS domains for this worker's tests, one after the other."""
    return _next_domain


@pytest.fixture(scope='session')
def log_directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder for what ROS nodes log, so that the user's home stays as it is."""
    return tmp_path_factory.mktemp('ros_log')


@pytest.fixture(autouse=True)
def isolated_ros(monkeypatch: pytest.MonkeyPatch, log_directory: Path) -> int:
    """Keep to a ROS domain that no other test and no robot nearby uses; return its number."""
    domain = next(_next_domain)
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
    # Benchmarks choose theirs among these.
    monkeypatch.setenv('WASD_TEST_DOMAINS', str(domain))
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    monkeypatch.setenv('ROS_LOG_DIR', str(log_directory))
    # Whatever starts the tests: a terminal of theirs knows escape sequences.
    monkeypatch.setenv('TERM', 'xterm')
    return domain


@pytest.fixture(autouse=True)
def interruptible() -> Iterator[None]:
    """
    Have Ctrl-C heard again after a test in which it has ended something: StopSignals ignores it.

    What the next test starts would inherit that.
    """
    before = signal.getsignal(signal.SIGINT)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(autouse=True)
def unbroken_legs(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    """
    Fail a test in which a leg controller has hidden an error of its own behind a recovery.

    One that is marked `broken_legs` means it.
    """
    module = sys.modules.get('quadruped_sim.leg_controller')
    if module is None or request.node.get_closest_marker('broken_legs') is not None:
        yield
        return
    recover, said = module.LegController._recover, []

    def recover_and_note(legs: Any, reading: Any, reason: str) -> Any:
        if reason.startswith(module.BROKE):
            said.append(reason)
        return recover(legs, reading, reason)

    monkeypatch.setattr(module.LegController, '_recover', recover_and_note)
    yield
    assert not said


@pytest.fixture
def ros(isolated_ros: int) -> Iterator[None]:
    """Have rclpy initialised as the project's nodes do it, and shut down afterwards."""
    import rclpy
    from wasd_core.node import init_ros

    init_ros([])
    yield
    rclpy.try_shutdown()


@pytest.fixture
def spin_until() -> Callable[..., None]:
    """Return `spin_until(pump, condition, timeout=PATIENCE, step=None)`."""
    return _spin_until


def _spin_until(
    pump: Any,
    condition: Callable[[], Any],
    timeout: float = PATIENCE,
    step: Callable[[], None] | None = None,
) -> None:
    """
    Handle messages until a condition holds; fail after `timeout` [s] of wall time.

    `pump` is a MessagePump or any other executor. `step` is called in between, e.g. to let a
    simulation run.
    """
    handle = getattr(pump, 'handle', None) or pump.spin_once
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline, f'waited {timeout} s in vain'
        if step is not None:
            step()
        handle(0.02 if step is None else 0.0)


class Spawner:
    """Puts nodes on one `pump` and destroys them in the end."""

    def __init__(self) -> None:
        from wasd_core.node import MessagePump

        self.pump = MessagePump()
        self._nodes: list[Any] = []

    def __call__(self, node: Any) -> Any:
        """Take charge of a node and return it."""
        self._nodes.append(node)
        self.pump.add_node(node)
        return node

    def close(self) -> None:
        """Destroy the nodes."""
        self.pump.shutdown(timeout_sec=0.0)
        for node in self._nodes:
            node.destroy_node()


@pytest.fixture
def spawn(ros: None) -> Iterator[Spawner]:
    """Return a function that puts a node on `spawn.pump` and destroys it after the test."""
    spawner = Spawner()
    yield spawner
    spawner.close()


@pytest.fixture(scope='session')
def launch_file() -> Callable[[Path], Any]:
    """Return a function that reads a launch file; see launch_files.py."""
    name = 'launch_files'
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f'{name}.py'))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look themselves up there
    spec.loader.exec_module(module)
    read: Callable[[Path], Any] = module.LaunchFile
    return read
