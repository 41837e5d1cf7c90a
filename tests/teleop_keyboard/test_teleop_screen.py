# SPDX-License-Identifier: Apache-2.0
"""The dashboard of `teleop` on a real pseudo-terminal, and what a dumb one gets."""

import fcntl
import struct
import termios
import time

from nav_msgs.msg import Odometry
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from terminals import PATIENCE

pytestmark = pytest.mark.slow

TELEOP = ('-m', 'teleop_keyboard.teleop_node')


def shows(process, text, since=0):
    deadline = time.monotonic() + PATIENCE
    while text.encode() not in process.output[since:]:
        assert time.monotonic() < deadline, process.output.decode()
        time.sleep(0.01)


def resize(process, columns, lines):
    size = struct.pack('HHHH', lines, columns, 0, 0)
    fcntl.ioctl(process.slave, termios.TIOCSWINSZ, size)


def test_it_shows_keys_robot_and_connection_and_follows_the_window(pty_process, listener):
    odometry = listener.node.create_publisher(Odometry, 'odom', 10)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    listener.node.create_publisher(String, 'state', latched).publish(String(data='trotting'))
    message = Odometry()
    message.twist.twist.linear.x = 0.17
    process = pty_process(*TELEOP, environment={'COLUMNS': '', 'LINES': ''})
    resize(process, 80, 24)
    listener.probe(process)
    shows(process, 'robot   trotting')
    shows(process, '1 subscriber, Twist')
    end = time.monotonic() + PATIENCE
    while b'+0.17 m/s' not in process.output:
        assert time.monotonic() < end
        process.type(b'i')
        odometry.publish(message)
        time.sleep(1 / 30)
    shows(process, '[i]')
    frames = process.output.decode(errors='replace').split('\x1b[?2026h\x1b[H')[1:]
    assert all(frame.count('\r\n') < 24 for frame in frames)
    assert b'\x1b[2J' not in process.output
    before = len(process.output)
    resize(process, 40, 10)
    shows(process, '\x1b[?2026h', before)
    process.type(b'q')
    shows(process, '0.22 m/s', before)
    frame = process.output[before:].decode(errors='replace').split('\x1b[?2026h\x1b[H')[-1]
    assert frame.count('\r\n') < 10
    process.type(b'\x03')
    assert process.wait() == 0
    shows(process, '\x1b[?25h\x1b[?1049l')


def test_a_dumb_terminal_gets_plain_lines_in_its_own_characters(pty_process, listener):
    environment = {'TERM': 'dumb', 'PYTHONIOENCODING': 'ascii'}
    process = pty_process(*TELEOP, environment=environment)
    listener.probe(process)
    process.type('é'.encode())
    process.wait_for(b'keys ?')
    process.type(b'\x03')
    assert process.wait() == 0
    assert b'\x1b' not in process.output
    assert b'Traceback' not in process.output
