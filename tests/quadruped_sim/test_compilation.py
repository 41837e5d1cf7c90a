# SPDX-License-Identifier: Apache-2.0
"""The controller is compiled once: it says so before, can be stopped meanwhile, and keeps it."""

import os
from pathlib import Path
import pty
import re
import select
import shutil
import signal
import subprocess
import sys
import time
import tty

import numba
import pytest
from quadruped_sim.compilation import compile_once, NOTICE
from terminals import PATIENCE, Stopwatch
import wasd
from wasd_core.errors import Stopped
from wasd_core.streams import Outlet, Words

import quadruped_sim
from quadruped_sim import compilation, legs

SOON = 5.0

USE = """
import sys
sys.path.insert(0, sys.argv[1])
import numpy as np
from quadruped_sim import algebra
print(algebra.__file__)
print(algebra.cross3(np.eye(3)[0], np.eye(3)[1])[2])
"""


@pytest.fixture
def function():
    """A function that was never compiled, and is kept nowhere."""
    return numba.njit(lambda x: x + 1)


@pytest.fixture
def here_only(monkeypatch):
    """What the other process compiles is of no use to this one, as without a cache."""
    monkeypatch.setattr(compilation, '_compile_elsewhere', lambda is_stopped: None)


@pytest.mark.slow
def test_what_is_compiled_is_used_in_silence(function):
    function(1)
    said = []
    compile_once(lambda: function(2), said.append)
    assert said == []


@pytest.mark.slow
def test_it_says_so_before_the_first_function_is_compiled(function, here_only):
    said = []
    compile_once(lambda: function(1), lambda text: said.append((text, function.signatures)))
    assert said == [(NOTICE, [])]
    assert len(function.signatures) == 1


def test_without_a_cache_a_stop_comes_before_the_next_function(function, here_only):
    calls = []

    def use():
        calls.append('used')
        function(1)

    with pytest.raises(Stopped):
        compile_once(use, lambda _: None, lambda: len(calls) == 2)
    assert calls == ['used', 'used']
    assert function.signatures == []


def test_an_error_of_what_is_used_comes_through(here_only):
    with pytest.raises(ZeroDivisionError):
        compile_once(lambda: 1 / 0, lambda _: None)


def test_a_terminal_shows_how_long_it_takes_in_one_line_that_is_wiped_away(monkeypatch):
    master, slave = pty.openpty()
    tty.setraw(slave)
    monkeypatch.setattr(sys, 'stderr', Words(Outlet(slave), 'utf-8', 'strict'))
    wait = [sys.executable, '-c', 'import time; time.sleep(0.3)']
    monkeypatch.setattr(compilation, 'COMPILE', wait)
    compilation._compile_elsewhere(lambda: False)
    shown = b''
    # The kernel hands it over in pieces.
    while not shown.endswith(b'\x1b[K') and select.select([master], [], [], SOON)[0]:
        shown += os.read(master, 4096)
    os.close(master)
    os.close(slave)
    assert re.fullmatch(rb'(\r\d+ s )+\r\x1b\[K', shown), shown


def users_of(folder: Path) -> list[int]:
    """Return the processes that were told to keep compiled code in a folder."""
    found = []
    for process in Path('/proc').glob('[0-9]*'):
        try:
            environment = (process / 'environ').read_bytes()
        except OSError:
            continue  # it has ended, or is none of ours
        if f'NUMBA_CACHE_DIR={folder}\0'.encode() in environment + b'\0':
            found.append(int(process.name))
    return found


@pytest.fixture
def compiling(request, tmp_path):
    """A program that walks the Go2 for the first time, with what it says, as it compiles."""
    module, arguments = {
        'leg_controller': ('quadruped_sim.leg_controller_node', []),
        'wasd': ('wasd_bringup.cli', ['go2', '--duration', '1', '--viewer', 'none']),
    }[request.param]
    said = tmp_path / 'said'
    with said.open('wb') as output:
        process = subprocess.Popen(
            [sys.executable, '-m', module, *arguments],
            env={**os.environ, 'NUMBA_CACHE_DIR': str(tmp_path / 'cache')},
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,
        )
    deadline = time.monotonic() + PATIENCE
    while NOTICE not in said.read_text():
        assert time.monotonic() < deadline
        assert process.poll() is None, said.read_text()
        time.sleep(0.02)
    yield process, said, tmp_path / 'cache'
    process.kill()
    process.wait()


@pytest.mark.slow
@pytest.mark.parametrize(
    ('compiling', 'number', 'status'),
    [('leg_controller', signal.SIGTERM, 128 + signal.SIGTERM), ('wasd', signal.SIGINT, 0)],
    indirect=['compiling'],
)
def test_a_signal_ends_the_compilation_at_once(number, status, compiling):
    process, said, cache = compiling
    # At any time, also while the other process has just begun.
    time.sleep(0.5)
    assert users_of(cache)
    stopwatch = Stopwatch(process.pid)
    process.send_signal(number)
    assert process.wait(PATIENCE) == status, said.read_text()
    assert stopwatch.took(time.time()) <= SOON
    assert said.read_text().count(NOTICE) == 1
    assert 'Traceback' not in said.read_text()
    assert users_of(cache) == []


@pytest.mark.slow
def test_an_installation_and_a_home_that_cannot_be_written_keep_nothing_and_it_runs(tmp_path):
    package = tmp_path / 'installed/quadruped_sim'
    source = Path(quadruped_sim.__file__).parent
    shutil.copytree(source, package, ignore=shutil.ignore_patterns('__pycache__'))
    (package / '__pycache__').touch()  # no folder can be made here, not even by root
    (tmp_path / 'none').touch()
    environment = {name: value for name, value in os.environ.items() if name[:4] != 'XDG_'}
    done = subprocess.run(
        [sys.executable, '-P', '-c', USE, str(package.parent)],
        env={**environment, 'HOME': str(tmp_path / 'none')},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [str(package / 'algebra.py'), '1.0']
    assert list(tmp_path.rglob('*.nbi')) == []


PRESS = """
import sys
from numba.core.registry import CPUDispatcher
from quadruped_sim.compilation import warm_up
from quadruped_sim.robot_model import RobotModel
from robot_description.description import load_robot
import wasd

def signatures():
    functions = [
        value
        for name, module in list(sys.modules.items())
        if name.startswith('quadruped_sim.')
        for value in vars(module).values()
        if isinstance(value, CPUDispatcher)
    ]
    return {(f.py_func.__qualname__, str(s)) for f in functions for s in f.signatures}

warm_up(RobotModel(load_robot('go2')))
before, states = signatures(), []
dog = wasd.Go2(seed=3)
for key, seconds in (
    ('2', 2.2), ('3', 0.2), ('2', 0.5), ('4', 0.4), ('w', 0.4), ('2', 0.7), ('5', 0.2), ('2', 0.5),
    ('0', 0.2), ('2', 0.5), ('8', 0.3), ('2', 0.7), ('9', 0.3), ('2', 0.7), ('v', 2.5), ('7', 2.0),
    ('1', 0.2), ('6', 2.5),
):
    dog.press(key)
    states.append(dog.state)
    if key == '5':
        dog.drive(0.3, 0.1, 0.2)
    dog.run(seconds)
from quadruped_sim.elevation import Elevation  # as when somebody begins to listen
Elevation().add([(0.1, 0.2, 0.3), (0.1, 0.2, 0.4)], 1e-4)
print(*states)
print(*signatures() - before)
"""


@pytest.mark.slow
def test_what_any_key_and_a_map_of_heights_call_is_compiled_before_the_first_tick():
    """In a program of its own: what other tests have used is compiled in this one."""
    ended = subprocess.run(
        [sys.executable, '-c', PRESS], capture_output=True, text=True, check=True, timeout=300
    )
    states, late = ended.stdout.splitlines()[-2:]
    assert late == ''
    assert len(set(states.split())) >= 9


@pytest.mark.slow
def test_of_two_robots_in_a_process_only_the_first_loads_what_is_compiled(monkeypatch):
    wasd.Go2()
    monkeypatch.setattr(legs, 'warm_up', lambda model: pytest.fail('it was loaded again'))
    dog = wasd.Go2()
    dog.press('2')
    dog.run(0.1)
    assert dog.state == 'fixed stand'
