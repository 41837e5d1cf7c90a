# SPDX-License-Identifier: Apache-2.0
"""The child process of bounded time: whatever ends it, nothing of it stays behind."""

import ctypes
import errno
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

import pytest
from robot_description.xacro import sandbox
from robot_description.xacro.sandbox import OutOfBounds, run_bounded


@pytest.fixture(autouse=True)
def nothing_stays():
    """Compare open files, blocked signals and children, also dead ones, with those before."""

    def seen():
        children = Path(f'/proc/self/task/{os.getpid()}/children').read_text().split()
        files = sorted(os.listdir('/proc/self/fd'))
        return children, files, signal.pthread_sigmask(signal.SIG_BLOCK, ())

    before = seen()
    yield
    assert seen() == before


@pytest.fixture
def handle():
    """Return a function that handles a signal during a test."""
    old = {}

    def handle(number, handler):
        old[number] = signal.signal(number, handler)

    yield handle
    for number, handler in old.items():
        signal.signal(number, handler)


def answer(job, note):
    return {**job, 'pid': os.getpid()}


def interrupt_itself(job, note):
    os.kill(os.getpid(), signal.SIGINT)
    return answer(job, note)


def interrupt_its_parent(job, note):
    # What is raised in the midst of a fork Python prints, and forgets: until the parent waits.
    state = Path(f'/proc/{os.getppid()}/stat')
    while state.read_text().rpartition(')')[2].split()[0] != 'S':
        time.sleep(0.01)
    os.kill(os.getppid(), signal.SIGINT)
    time.sleep(60.0)


def crash(job, note):
    note('here')
    ctypes.string_at(0)


def test_the_answer_is_another_process_s():
    assert run_bounded(answer, {'a': 1})['pid'] != os.getpid()


def test_a_process_that_cannot_be_forked_is_an_error_of_one_line(monkeypatch):
    def fork():
        raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))

    monkeypatch.setattr(os, 'fork', fork)
    with pytest.raises(OutOfBounds, match='^needs a process of its own: Resource temporarily'):
        run_bounded(answer, {})


def test_ctrl_c_is_for_the_parent_to_say(handle):
    """A terminal sends it to both; where the parent only notes it, the work goes on."""
    handle(signal.SIGINT, lambda *_: None)
    assert run_bounded(interrupt_itself, {'a': 1})['a'] == 1


def test_an_interrupted_parent_ends_its_child(handle):
    handle(signal.SIGINT, signal.default_int_handler)
    with pytest.raises(KeyboardInterrupt):
        run_bounded(interrupt_its_parent, {})


def test_it_answers_where_the_system_keeps_no_record_of_children(handle):
    handle(signal.SIGCHLD, signal.SIG_IGN)
    assert run_bounded(answer, {'a': 1})['a'] == 1


def test_a_crash_says_where():
    with pytest.raises(OutOfBounds, match='^ended Python: nested too deep') as caught:
        run_bounded(crash, {})
    assert caught.value.note == 'here'


def test_too_long_an_answer_is_refused(monkeypatch):
    monkeypatch.setattr(sandbox, 'LARGEST_ANSWER', 10)
    with pytest.raises(OutOfBounds, match='or made more than'):
        run_bounded(answer, {'a': 'x' * 100})


ORPHAN = """
import os, signal
from robot_description.xacro.sandbox import run_bounded

def answer_nobody(job, note):
    os.kill(os.getppid(), signal.SIGKILL)
    return {size} * 'x'

run_bounded(answer_nobody, {{}})
"""


@pytest.mark.slow
@pytest.mark.parametrize('size', [1, 1_000_000])  # what a pipe holds, and more
def test_a_child_whose_parent_was_killed_ends(size):
    # Both have its output: `run` returns when the last of them has ended.
    words = [sys.executable, '-c', ORPHAN.format(size=size)]
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert done.returncode == -signal.SIGKILL
    assert done.stdout == b''


@pytest.mark.slow
def test_a_child_that_waits_for_ever_ends_by_itself(monkeypatch):
    monkeypatch.setattr(sandbox, 'WALL', 0.5)
    monkeypatch.setattr(sandbox.select, 'select', lambda *wanted: [True])
    with pytest.raises(OutOfBounds, match='^took more than 0.5 s'):
        run_bounded(lambda job, note: time.sleep(60.0), {})
