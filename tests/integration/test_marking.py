# SPDX-License-Identifier: Apache-2.0
"""Tests are marked by what they use; no two workers share a ROS domain, none hangs for ever."""

from pathlib import Path

import pytest

from wasd_bringup import cli

pytest_plugins = ['pytester']

ROOT = Path(__file__).resolve().parents[2]
SAMPLE = """
import functools
import subprocess
import sys

import pytest


def start():
    subprocess.run([sys.executable, '-c', ''], check=True)


@functools.cache
def start_once():
    start()


@pytest.fixture
def through_a_fixture():
    from wasd_core.node import init_ros

    return init_ros


def test_process():
    start_once()


def test_ros(through_a_fixture):
    assert through_a_fixture is not None


def test_quick():
    assert True


def test_liar():
    __import__('os').system('true')
"""


@pytest.fixture
def sample(pytester: pytest.Pytester) -> pytest.Pytester:
    """Return a folder with tests of each kind, marked as the project's own."""
    plugin = (ROOT / 'tests' / 'marking.py').read_text()
    pytester.makepyfile(marking=plugin, test_sample=SAMPLE)
    pytester.makeconftest("pytest_plugins = ['marking']")
    pytester.makeini('[pytest]\nmarkers = slow: for later')
    return pytester


@pytest.mark.parametrize(('mark', 'test'), [('process', 'test_process'), ('ros', 'test_ros')])
def test_a_test_is_marked_by_what_it_reaches_through_helpers_and_fixtures(sample, mark, test):
    collected = sample.runpytest_subprocess('--collect-only', '-q', '-m', mark)
    assert [line for line in collected.outlines if '::' in line] == [f'test_sample.py::{test}']


def test_a_test_that_is_quick_by_its_marks_cannot_start_a_process(sample):
    done = sample.runpytest_subprocess('-m', 'not process and not ros')
    done.assert_outcomes(passed=1, failed=1, deselected=2)
    done.stdout.fnmatch_lines(['*test_liar is marked quick, but causes os.system*'])


HANGS = """
import ctypes


def test_hangs():
    ctypes.PyDLL(None).sleep(60)  # as a library does that waits with Python's lock


def test_after():
    assert True
"""


def test_a_worker_that_hangs_is_ended_and_the_test_named(pytester, monkeypatch):
    pytester.makepyfile(hanging=(ROOT / 'tests/hanging.py').read_text(), test_sample=HANGS)
    pytester.makeconftest("pytest_plugins = ['hanging']")
    monkeypatch.setenv('WASD_TEST_LIMIT', '1')
    done = pytester.runpytest_subprocess('-n', '1', *cli.WORKERS[2:])
    done.assert_outcomes(failed=1)
    assert done.ret == pytest.ExitCode.INTERNAL_ERROR  # what came after it, nobody has looked at
    done.stdout.fnmatch_lines(["*worker 'gw0' crashed while running 'test_sample.py::test_hangs'"])
    done.stderr.fnmatch_lines(['*test_sample.py", line * in test_hangs'])


def test_the_longest_files_come_first(request):
    ranks = {name: rank for rank, name in enumerate(longest_files(request))}
    files = list(dict.fromkeys(item.path.stem[5:] for item in request.session.items))
    assert files == sorted(files, key=lambda name: ranks.get(name, len(ranks)))
    known = {path.stem[5:] for path in (ROOT / 'tests').rglob('test_*.py')}
    assert set(ranks) <= known


def longest_files(request):
    (plugin,) = (
        plugin
        for plugin in request.config.pluginmanager.get_plugins()
        if getattr(plugin, '__file__', None) == str(ROOT / 'tests/conftest.py')
    )
    return plugin.LONGEST


def test_workers_share_no_ros_domain(domains_of_worker):
    parts = [set(domains_of_worker(worker, 3, '1-100')) for worker in range(3)]
    assert set.union(*parts) == set(range(1, 101))
    assert sum(map(len, parts)) == 100


def test_several_test_runs_can_keep_apart(domains_of_worker):
    assert set(domains_of_worker(1, 2, '14-27')) == set(range(15, 28, 2))
