# SPDX-License-Identifier: Apache-2.0
"""A terminal that takes no more output: the robot stops all the same, and the process ends."""

import os
import signal
import termios
import time

import pytest
from terminals import end_by, wait_until

pytestmark = pytest.mark.slow

TELEOP = ('-m', 'teleop_keyboard.teleop_node')
KEYBOARD = ('-m', 'teleop_keyboard.key_publisher_node')


def freeze(process, how):
    """Have the terminal take nothing more: nobody reads it, or it was told to hold (XOFF)."""
    if how == 'unread':
        process.freeze()
    else:
        termios.tcflow(process.slave, termios.TCOOFF)


@pytest.mark.parametrize('how', ['unread', 'XOFF'])
def test_a_robot_stops_after_the_last_key_though_the_screen_is_frozen(pty_process, listener, how):
    process = pty_process(*TELEOP)
    listener.probe(process)
    listener.drive(process)
    freeze(process, how)

    for _ in range(2):  # and after that it still drives and stops
        listener.twists.clear()
        listener.drive(process, seconds=1.0)
        # How soon, other tests ask: one that waited for the screen would never stop.
        wait_until(lambda: listener.stands)
    if how == 'unread':
        listener.drive(process)
        assert_it_ends(process, listener, signal.SIGTERM)


def assert_it_ends(process, listener, number):
    """End a driver by a signal."""
    end_by(process.process, number)
    assert process.attributes == process.before
    wait_until(lambda: listener.stands)


@pytest.mark.parametrize(
    ('program', 'number'),
    [(TELEOP, signal.SIGINT), (TELEOP, signal.SIGHUP), (KEYBOARD, signal.SIGHUP)],
)
def test_a_signal_ends_it_though_the_screen_is_frozen(pty_process, listener, program, number):
    process = pty_process(*program)
    listener.probe(process)
    process.freeze()
    if program is KEYBOARD:
        end_by(process.process, number)
        assert process.attributes == process.before
    else:
        listener.drive(process, seconds=1.0)
        assert_it_ends(process, listener, number)


def test_a_screen_that_thaws_is_shown_again_whole_and_the_shell_s_stays_as_it_was(
    pty_process, listener
):
    process = pty_process(*TELEOP)
    listener.probe(process)
    process.freeze()
    process.type(b'q' * 3)
    time.sleep(0.5)
    process.thaw()
    process.wait_for(b'.' * 100)
    process.type(b'q')
    process.wait_for(b'0.29 m/s')
    # The terminal hands it over in pieces.
    wait_until(lambda: process.output.endswith(b'\x1b[J\x1b[?2026l'))
    last = process.output.rsplit(b'\x1b[?2026h\x1b[H', 1)[1]
    assert b'Control mbot!' in last

    # Standard input is shared with whoever started us: this test's end of it.
    assert os.get_blocking(process.slave)
    process.type(b'\x03')
    assert process.wait() == 0
    assert os.get_blocking(process.slave)


def test_the_log_of_ros_does_not_wait_for_the_terminal_either(pty_process, listener):
    program = (
        'import rclpy, sys\n'
        'from wasd_core import streams\n'
        'streams.prepare_streams(); streams.never_wait()\n'
        'rclpy.init()\n'
        'node = rclpy.create_node("talks")\n'
        'print("READY", flush=True)\n'
        'sys.stdin.readline()\n'
        'for _ in range(300): node.get_logger().error("x" * 200)\n'
        'print("y" * 5000); print("z" * 5000, file=sys.stderr)\n'
        'sys.exit(7)\n'
    )
    process = pty_process('-c', program)
    process.wait_for(b'READY')
    process.freeze()
    process.type(b'\n')
    assert process.wait() == 7
