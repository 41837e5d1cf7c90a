# SPDX-License-Identifier: Apache-2.0
"""Every signal that can be caught: the last word is zero, the terminal is as it was."""

import os
import signal

import pytest
from teleop_keyboard.keys_to_twist import STANDSTILL
from terminals import end_by, name_of, wait_until
from wasd_core.signals import DEADLY

pytestmark = pytest.mark.slow

TELEOP = ('-m', 'teleop_keyboard.teleop_node')
# Python ignores these, and so do its programs: an error says what they would.
IGNORED = (signal.SIGPIPE, signal.SIGXFSZ)
ENDING = [number for number in DEADLY if number not in IGNORED]
# Ctrl-C is Python's own, a KeyboardInterrupt; of those without a name some will do.
ALONE = [
    number for number in ENDING if isinstance(number, signal.Signals) and number != signal.SIGINT
]
# A process for each signal and state takes a while: WASD_TEST_SIGNALS=all has them all.
EVERY = os.environ.get('WASD_TEST_SIGNALS') == 'all'
WHILE_DRIVING = ALONE if EVERY else [signal.SIGRTMIN]
WHILE_IDLE = ALONE if EVERY else [signal.SIGUSR1]
WHILE_STARTING = [signal.SIGINT, *(ALONE if EVERY else [signal.SIGABRT])]

# A terminal in raw mode and nothing else.
HOLDER = """
import os, time
from teleop_keyboard.terminal import Terminal
with Terminal(0) as terminal:
    # No print: the signal may come while the next line is being printed.
    terminal.before_suspend.append(lambda: os.write(1, b'zero'))
    print('ready', flush=True)
    for _ in range(600):  # a signal that comes just before a sleep does not end it
        time.sleep(0.1)
"""
# Starts, and is stuck in its start for as long as it takes.
STUCK = """
import sys, time
from teleop_keyboard import teleop_node as module
module.KeysToTwistNode = lambda: print('STARTING', flush=True) or time.sleep(60.0)
sys.exit(module.main())
"""
# Is stuck in the midst of driving, at the key X.
STUCK_LATER = """
import sys, time
from teleop_keyboard import teleop_node as module
publish = module.KeyPublisherNode.publish_key
def publish_or_hang(self, key):
    if key == 'X':
        print('STUCK', flush=True)
        time.sleep(60.0)
    publish(self, key)
module.KeyPublisherNode.publish_key = publish_or_hang
sys.exit(module.main())
"""


def end(process, number):
    """Send a signal; check how and how soon the process ends, and what is left."""
    end_by(process.process, number)
    assert process.attributes == process.before
    assert b'Traceback' not in process.output


@pytest.mark.parametrize('number', ALONE, ids=name_of)
def test_each_gives_a_raw_terminal_back_and_ends_the_process(pty_process, number):
    process = pty_process('-c', HOLDER)
    process.wait_for(b'ready')
    assert process.is_raw
    process.process.send_signal(number)
    assert process.wait() == -number
    assert process.attributes == process.before
    wait_until(lambda: b'zero' in process.output)


@pytest.mark.parametrize('number', WHILE_DRIVING, ids=name_of)
def test_each_stops_the_robot_while_it_is_driven(pty_process, listener, number):
    process = pty_process(*TELEOP)
    listener.probe(process)
    listener.drive(process)
    end(process, number)
    wait_until(lambda: listener.stands)
    listener.settle()
    assert listener.stands
    assert process.output.rstrip().endswith(b'\x1b[?1049l')


@pytest.mark.parametrize('number', WHILE_IDLE, ids=name_of)
def test_each_ends_it_while_it_is_idle(pty_process, listener, number):
    process = pty_process(*TELEOP)
    listener.probe(process)
    end(process, number)
    listener.settle()
    assert set(listener.velocities) <= {STANDSTILL}


@pytest.mark.parametrize('number', WHILE_STARTING, ids=name_of)
def test_each_ends_it_while_it_is_stuck_in_its_start(ros_domain, pty_process, number):
    process = pty_process('-c', STUCK)
    process.wait_for(b'STARTING')
    assert process.is_raw
    end(process, number)


def test_a_loop_that_is_stuck_is_ended_with_a_zero(pty_process, listener):
    # Driven by a key that latches, it moves until the test is there.
    process = pty_process('-c', STUCK_LATER, '--ros-args', '-p', 'mode:=latch')
    listener.probe(process)
    listener.drive(process)
    process.type(b'X')
    process.wait_for(b'STUCK')
    assert listener.velocities[-1] != STANDSTILL
    end(process, signal.SIGTERM)
    wait_until(lambda: listener.stands)


def test_signals_that_python_ignores_leave_a_driver_in_charge(pty_process, listener):
    process = pty_process(*TELEOP)
    listener.probe(process)
    for number in (*IGNORED, signal.SIGWINCH, signal.SIGURG, signal.SIGCHLD):
        process.process.send_signal(number)
    listener.drive(process)
    assert process.is_raw
    process.type(b'\x03')
    assert process.wait() == 0
    wait_until(lambda: listener.stands)


@pytest.mark.parametrize('number', [signal.SIGTTIN, signal.SIGTTOU], ids=name_of)
def test_what_suspends_it_leaves_a_zero_and_the_terminal_and_it_goes_on(
    pty_process, listener, tmp_path, number
):
    # Its shell has to be there: without one the system does not stop a process.
    shell = (
        'import os, signal, subprocess, sys, time\n'
        'signal.signal(signal.SIGTTOU, signal.SIG_IGN)\n'
        'job = os.fork()\n'
        'if job == 0:\n'
        '    os.setpgid(0, 0); os.tcsetpgrp(0, os.getpgrp())\n'
        '    signal.signal(signal.SIGTTOU, signal.SIG_DFL)\n'
        '    os.execv(sys.executable, [sys.executable, *sys.argv[1:]])\n'
        'print("JOB", job, flush=True)\n'
        'os.waitpid(job, os.WUNTRACED)\n'
        'print("STOPPED", flush=True)\n'
        'while not os.path.exists(os.environ["GO_ON"]): time.sleep(0.01)\n'
        'os.kill(job, signal.SIGCONT)\n'
        'sys.exit(os.waitstatus_to_exitcode(os.waitpid(job, 0)[1]))\n'
    )
    go_on = tmp_path / 'go_on'
    process = pty_process('-c', shell, *TELEOP, environment={'GO_ON': str(go_on)})
    listener.probe(process)
    job = int(process.output.split(b'JOB ')[1].split()[0])
    listener.drive(process)
    os.kill(job, number)
    wait_until(lambda: b'STOPPED' in process.output)
    assert process.attributes == process.before
    wait_until(lambda: listener.stands)
    go_on.touch()
    wait_until(lambda: process.is_raw)
    listener.settle()
    assert listener.stands
    process.type(b'\x03')
    assert process.wait() == 0
    assert process.attributes == process.before
