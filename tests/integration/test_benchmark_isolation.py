# SPDX-License-Identifier: Apache-2.0
"""What is measured is measured alone: no part of the benchmark, no run beside it, is heard."""

from collections.abc import Callable, Iterator
import contextlib
import os
from pathlib import Path
import subprocess
import sys
import threading
import time
from typing import Any
import uuid

from geometry_msgs.msg import Twist
import pytest
import rclpy
from rclpy.node import Node
from terminals import PATIENCE

pytestmark = pytest.mark.slow

BENCHMARKS = Path(__file__).parents[2] / 'benchmarks'
# A part that does to its process what a keyboard and a renderer do, and one that looks around.
PARTS = """
import os, pathlib, sys, unittest.mock
sys.path.insert(0, {folder!r})
# Stand-ins of the other parts, which take seconds to load.
for file in pathlib.Path({folder!r}).glob('*.py'):
    if file.stem not in ('run', 'table', 'family', 'experiment', 'page'):
        sys.modules[file.stem] = unittest.mock.MagicMock()
import run
from table import Row

def careless(quick, note):
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    return []

def curious(quick, note):
    seen = os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE')
    return [Row(what='', measured=str(seen), must='', passed=True)]

run.PARTS |= {{'careless': careless, 'curious': curious}}
if __name__ == '__main__':
    before = dict(os.environ)
    asked = run.make_parser().parse_args([])
    rows = [*run.measure('careless', asked), *run.measure('curious', asked)]
    print(rows[0].measured, os.environ == before)
"""
STANDS = '0 0 0 0\n'
LONG = ('--duration', '40')  # at full speed still seconds of wall time
ALONE = 1e-6  # a robot that nobody else drives stays within so much [m]


def test_no_part_of_the_benchmark_changes_the_environment_of_another(tmp_path: Path) -> None:
    script = tmp_path / 'parts.py'
    script.write_text(PARTS.format(folder=str(BENCHMARKS)))
    environment = {**os.environ}
    environment.pop('ROS_AUTOMATIC_DISCOVERY_RANGE')
    done = subprocess.run(
        [sys.executable, str(script)], env=environment, capture_output=True, text=True
    )
    assert (done.stdout, done.returncode) == ('None True\n', 0), done.stderr


def commands(mark: str) -> list[str]:
    """Return the command lines of all processes with a variable of this value."""
    found = []
    for folder in Path('/proc').glob('[0-9]*'):
        with contextlib.suppress(OSError):  # it has ended meanwhile
            if f'WASD_MARK={mark}\0'.encode() in (folder / 'environ').read_bytes():
                found.append((folder / 'cmdline').read_text())
    return found


def look_until(condition: Callable[[], bool]) -> None:
    """Wait until a condition holds that takes a while to look at."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, 'waited in vain'
        time.sleep(0.1)


def test_nothing_is_left_of_a_benchmark_that_was_killed(tmp_path: Path) -> None:
    mark = uuid.uuid4().hex
    words = [sys.executable, '-m', 'wasd_bringup.cli', 'bench', 'mbot', '--quick']
    bench = subprocess.Popen(words, cwd=tmp_path, env={**os.environ, 'WASD_MARK': mark})
    look_until(lambda: any('--twist' in each for each in commands(mark)))
    bench.kill()
    bench.wait()
    look_until(lambda: not commands(mark))


@pytest.fixture(scope='module')
def domain(ros_domains: Iterator[int]) -> Iterator[int]:
    """Yield a ROS domain in which another program tells a robot to drive, all the time."""
    domain = next(ros_domains)
    context = rclpy.Context()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
        rclpy.init(context=context, domain_id=domain)
    publisher = Node('other', context=context).create_publisher(Twist, 'cmd_vel', 10)
    goes = Twist()
    goes.linear.x = 0.3
    is_over = threading.Event()

    def publish() -> None:
        while not is_over.wait(0.01):
            publisher.publish(goes)

    thread = threading.Thread(target=publish)
    thread.start()
    yield domain
    is_over.set()
    thread.join()
    rclpy.shutdown(context=context)


def test_a_script_at_full_speed_hears_nobody_whatever_the_environment_says(
    new_runner: Any, domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    monkeypatch.setenv('ROS_LOCALHOST_ONLY', '1')
    # Who can meet has met by then, as the next test shows.
    assert distance_beside_another(new_runner, domain, *LONG) < ALONE


def test_a_script_at_full_speed_has_company_when_it_is_asked_for(
    new_runner: Any, domain: int
) -> None:
    distance = distance_beside_another(new_runner, domain, '--discovery', 'localhost', *LONG)
    assert distance > 1e3 * ALONE


def distance_beside_another(new_runner: Any, domain: int, *words: str) -> float:
    """Return how far a robot that is told to stand goes beside one that is told to drive [m]."""
    report = new_runner(domain).report('mbot', *words, twist=STANDS)
    x, y, _ = report['samples']['position'][-1]
    return float(x**2 + y**2) ** 0.5
