# SPDX-License-Identifier: Apache-2.0
"""A megabyte that is pasted on a real terminal drives nobody, and keys typed after it count."""

import os
import threading
import time

import pytest
from teleop_keyboard.typed_keys import PASTE_BEGIN, PASTE_END
from terminals import PATIENCE, Stopwatch, wait_until

pytestmark = pytest.mark.slow

TELEOP = ('-m', 'teleop_keyboard.teleop_node')
KEYS = ('-m', 'teleop_keyboard.key_publisher_node')
MBOT = ('-m', 'wasd_bringup.cli', 'mbot', '--viewer', 'none')
TEXT = b'i' * 1_000_000


def paste(process, data):
    """Paste as a terminal does, waiting for room until all of it was taken."""
    writer = threading.Thread(target=lambda: write_all(process.master, data), daemon=True)
    writer.start()
    writer.join(PATIENCE)
    assert not writer.is_alive()


def write_all(descriptor, data):
    while data:
        data = data[os.write(descriptor, data) :]


def moves(listener):
    """Return how many commands to move came; mbot is sent 50 a second."""
    return sum(1 for velocity in listener.velocities if velocity.vx != 0.0)


def assert_pastes_are_no_longer_marked(process, end):
    """End a program by what is typed, or by SIGTERM; look at the terminal that it leaves."""
    assert b'\x1b[?2004l' not in process.output
    if end == 'TERM':
        process.process.terminate()
    else:
        process.type(end)
    process.wait()
    process.wait_for(b'\x1b[?2004l')
    assert process.attributes == process.before


@pytest.mark.parametrize(
    ('program', 'marks', 'end'),
    [
        ('teleop', (b'', b''), b'\x03'),
        ('teleop', (PASTE_BEGIN, PASTE_END), b'\x1c'),
        ('pair', (b'', b''), b'\x03'),
        ('mbot', (b'', b''), b'\x03'),
    ],
)
def test_a_pasted_megabyte_drives_for_no_more_than_0_3_s(
    program, marks, end, pty_process, listener, background
):
    if program == 'pair':
        background('teleop_keyboard.keys_to_twist_node', '--ros-args', '-p', 'preset:=mbot')
    process = pty_process(*{'teleop': TELEOP, 'pair': KEYS, 'mbot': MBOT}[program])
    wait_until(lambda: listener.node.count_publishers('cmd_vel') > 0)
    wait_until(lambda: b'\x1b[?2004h' in process.output)
    paste(process, marks[0] + TEXT + marks[1])
    time.sleep(1.0)
    assert moves(listener) <= 0.3 * 50
    # And the keyboard is alive.
    listener.drive(process)
    assert_pastes_are_no_longer_marked(process, end)


def test_a_stop_key_overtakes_what_was_pasted_before_it(pty_process, listener):
    """The robot drives by a key that latches, which no paste between brackets ends."""
    process = pty_process(*TELEOP, '--ros-args', '-p', 'mode:=latch')
    listener.probe(process)

    process.type(b'i')
    wait_until(lambda: listener.velocities and listener.velocities[-1].vx > 0.15)
    paste(process, PASTE_BEGIN + TEXT + PASTE_END)
    stopwatch = Stopwatch(process.process.pid)
    assert listener.velocities[-1].vx > 0.15
    process.type(b' ')
    wait_until(lambda: listener.stands)
    assert stopwatch.took(listener.moved_at) <= 0.2
    assert_pastes_are_no_longer_marked(process, 'TERM')
