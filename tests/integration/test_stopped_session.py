# SPDX-License-Identifier: Apache-2.0
"""`wasd` on a terminal that is frozen, under every signal, suspended, or stuck: it stops."""

from collections.abc import Callable
import json
import os
from pathlib import Path
import signal
import termios
import time
from typing import Any

import pytest
from terminals import end_by, name_of, PATIENCE, Stopwatch, wait_until, ZERO_AFTER
from wasd_core.signals import DEADLY

pytestmark = pytest.mark.slow

WASD = ('-m', 'wasd_bringup.cli')
# The same command, stuck in its start, or in the midst of the run at the key X.
STUCK_AT_START = """
import sys, time
from wasd_bringup.run import run
run.build_robots = lambda *_: print('STARTING', flush=True) or time.sleep(60.0)
from wasd_bringup.cli import main
sys.exit(main(sys.argv[1:]))
"""
STUCK_LATER = """
import sys, time
from wasd_bringup.run.run import Run
press = Run.press
def press_or_hang(self, key, *rest):
    if key == 'X':
        time.sleep(60.0)
    press(self, key, *rest)
Run.press = press_or_hang
from wasd_bringup.cli import main
sys.exit(main(sys.argv[1:]))
"""
# A shell with one job, which it puts in front again when the test says so, as `fg` does.
SHELL = """
import os, signal, sys, time
signal.signal(signal.SIGTTOU, signal.SIG_IGN)
job = os.fork()
if job == 0:
    os.setpgid(0, 0)
    os.tcsetpgrp(0, os.getpgrp())
    signal.signal(signal.SIGTTOU, signal.SIG_DFL)
    os.execv(sys.executable, [sys.executable, *sys.argv[1:]])
os.waitpid(job, os.WUNTRACED)
os.tcsetpgrp(0, os.getpgrp())
print('SUSPENDED', flush=True)
while not os.path.exists('fg'):
    time.sleep(0.01)
print('IN FRONT', flush=True)
os.tcsetpgrp(0, job)
os.kill(job, signal.SIGCONT)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(job, 0)[1]))
"""
# A run for each signal takes a while: WASD_TEST_SIGNALS=all has them all, in every state.
EVERY = os.environ.get('WASD_TEST_SIGNALS') == 'all'
IGNORED = (signal.SIGPIPE, signal.SIGXFSZ)
ENDING = [
    number for number in DEADLY if isinstance(number, signal.Signals) and number not in IGNORED
]
WHILE_DRIVING = ENDING if EVERY else [signal.SIGTERM, signal.SIGABRT]
WHILE_IDLE = ENDING if EVERY else [signal.SIGALRM]
WHILE_STARTING = ENDING if EVERY else [signal.SIGINT, signal.SIGVTALRM]


def end(session: Any, number: int) -> None:
    """Send a signal; check how and how soon the process ends and what is left."""
    end_by(session.process, number)
    assert termios.tcgetattr(session.slave) == session.before
    session.read()
    assert 'Traceback' not in session.shown


def wait_for_zero(commands: Any) -> None:
    """Wait until the last command is to stand, and see that it stays the last."""
    deadline = time.monotonic() + PATIENCE
    while (last := commands(0.01)[-1]).linear.x != 0.0 or last.angular.z != 0.0:
        assert time.monotonic() < deadline, 'no zero'
    count = len(commands(0.0))
    assert not any(one.linear.x or one.angular.z for one in commands(0.3)[count:])


def test_a_robot_stops_after_the_last_key_though_the_screen_is_frozen(
    start: Callable[..., Any], commands: Any, hold_until_it_drives: Any, tmp_path: Path
) -> None:
    session = start('--report', 'report.json')
    session.wait_for('stopped')
    hold_until_it_drives(session, commands)
    session.freeze()

    def press() -> bool:
        session.type('i')
        return bool(commands(1 / 30)[-1].linear.x > 0.0)

    for _ in range(29):
        press()
    wait_until(press)
    session.type('i')
    stopwatch = Stopwatch(session.process.pid)
    wait_for_zero(commands)
    moved = max(sent for sent, twist in commands.sent if twist.linear.x)
    assert stopwatch.took(moved) <= ZERO_AFTER
    wait_until(press)
    assert_a_signal_ends_the_drive(session, commands, signal.SIGHUP, tmp_path)


def assert_a_signal_ends_the_drive(session: Any, commands: Any, number: int, folder: Path) -> None:
    """End a drive whose screen is frozen; its report is whole."""
    session.type('i')
    end(session, number)
    wait_for_zero(commands)
    assert json.loads((folder / 'report.json').read_text())['samples']['t']


def test_ctrl_c_ends_the_drive_though_the_screen_is_frozen(
    start: Callable[..., Any], commands: Any, hold_until_it_drives: Any, tmp_path: Path
) -> None:
    session = start('--report', 'report.json')
    session.wait_for('stopped')
    hold_until_it_drives(session, commands)
    session.freeze()
    assert_a_signal_ends_the_drive(session, commands, signal.SIGINT, tmp_path)


@pytest.mark.parametrize('number', WHILE_DRIVING, ids=name_of)
def test_every_signal_stops_the_robot_and_restores_the_terminal(
    start: Callable[..., Any], commands: Any, hold_until_it_drives: Any, number: int
) -> None:
    session = start()
    session.wait_for('stopped')
    hold_until_it_drives(session, commands)
    end(session, number)
    wait_for_zero(commands)


@pytest.mark.parametrize('number', WHILE_IDLE, ids=name_of)
def test_every_signal_ends_an_idle_run_in_order(start: Callable[..., Any], number: int) -> None:
    session = start('--report', 'report.json', robot='go2')
    session.wait_for('passive')
    end(session, number)
    assert 'report in report.json' in session.shown


@pytest.mark.parametrize('number', WHILE_STARTING, ids=name_of)
def test_every_signal_ends_a_run_that_is_stuck_in_its_start(
    start: Callable[..., Any], number: int
) -> None:
    session = start(program=('-c', STUCK_AT_START))
    session.wait_for('STARTING')
    end(session, number)


def test_a_run_that_is_stuck_is_ended_with_a_zero(
    start: Callable[..., Any], commands: Any, hold_until_it_drives: Any
) -> None:
    session = start(program=('-c', STUCK_LATER))
    session.wait_for('stopped')
    hold_until_it_drives(session, commands)
    session.type('X')
    end(session, signal.SIGTERM)
    wait_for_zero(commands)


def test_ctrl_z_stops_the_robot_and_after_fg_the_status_is_back_and_nothing_moves(
    start: Callable[..., Any], commands: Any, hold_until_it_drives: Any, tmp_path: Path
) -> None:
    session = start(program=('-c', SHELL, *WASD))
    session.wait_for('stopped')
    hold_until_it_drives(session, commands)
    session.hold('i', 0.3)
    session.type('\x1a')
    session.wait_for('SUSPENDED')
    assert termios.tcgetattr(session.slave) == session.before
    wait_for_zero(commands)
    time.sleep(2.0)
    count = len(commands(0.5))  # with what a busy machine delivers late
    (tmp_path / 'fg').touch()
    session.wait_for('IN FRONT')
    session.shown = ''
    session.wait_for('stopped')
    assert not any(one.linear.x or one.angular.z for one in commands(1.0)[count:])
    session.type('\x03')
    assert session.end() == 0
    assert termios.tcgetattr(session.slave) == session.before
