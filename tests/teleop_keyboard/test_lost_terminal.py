# SPDX-License-Identifier: Apache-2.0
"""
A terminal that tells releases falls silent while a key is down: the robot stands soon after.

The test plays the terminal, which announces the protocol before, during or after the first press,
or never; then it hangs, as ssh does.
"""

import itertools
import time

from geometry_msgs.msg import Twist
import pytest
from terminals import Stopwatch, wait_until

pytestmark = pytest.mark.slow

TELEOP = ('-m', 'teleop_keyboard.teleop_node')
KEYS = ('-m', 'teleop_keyboard.key_publisher_node')
TWIST = 'teleop_keyboard.keys_to_twist_node'
MBOT = ('-m', 'wasd_bringup.cli', 'mbot', '--viewer', 'none')
ANSWER = b'\x1b[?0u'
PRESS, REPEAT, RELEASE = b'\x1b[105;;105u', b'\x1b[105;1:2;105u', b'\x1b[105;1:3u'
# The keyboard's delay and period [s], and what the issue of a lost terminal is bounded by.
DELAY, PERIOD = 0.4, 1 / 30
AFTER_REPEAT, AFTER_PRESS = 0.4, 0.7


class Moves:
    """When cmd_vel was sent that was not zero; a key that stops has come all the way before."""

    def __init__(self, listener, process):
        self.times, self._is_heard = [], False
        listener.node.create_subscription(Twist, 'cmd_vel', self._take, 100)

        def arrives():
            process.type(b' ')
            time.sleep(0.1)
            return self._is_heard

        wait_until(arrives)

    def _take(self, message, info):
        self._is_heard = True
        if message.linear.x != 0.0:
            self.times.append(1e-9 * info['source_timestamp'])


def hold(process, seconds, announce_at=None):
    """Hold i, without its end; return a stopwatch that began when it was told last."""
    start = time.monotonic()
    process.type(PRESS)
    stopwatch = Stopwatch(process.process.pid)
    due = start + DELAY
    while due < start + seconds:
        if announce_at is not None and time.monotonic() >= start + announce_at:
            process.type(ANSWER)
            announce_at = None
        time.sleep(max(due - time.monotonic(), 0.0))
        process.type(REPEAT)
        stopwatch, due = Stopwatch(process.process.pid), due + PERIOD
    return stopwatch


def wait_for_end(moves):
    """Wait until no move has come for a second; return when the last one was sent."""
    wait_until(lambda: moves.times and time.time() > moves.times[-1] + 1.0)
    return moves.times[-1]


@pytest.fixture
def teleop(pty_process, listener):
    process = pty_process(*TELEOP)
    listener.probe(process)
    return process


@pytest.fixture
def pair(pty_process, listener, background):
    background(TWIST, '--ros-args', '-p', 'preset:=mbot')
    process = pty_process(*KEYS)
    listener.probe(process)
    wait_until(lambda: listener.node.count_publishers('cmd_vel') > 0)
    return process


@pytest.fixture
def mbot(pty_process, listener):
    process = pty_process(*MBOT)
    process.wait_for(b'Ctrl-C quit')
    wait_until(lambda: listener.node.count_publishers('cmd_vel') > 0)
    return process


# While the first press is about to repeat; between its repeats; never.
ANNOUNCED = {'during': 0.0, 'after': 0.6, 'never': None}


@pytest.mark.parametrize(
    ('program', 'announced'),
    # The others read keys as teleop does.
    [('teleop', 'during'), ('pair', 'after'), ('mbot', 'never')],
)
def test_a_key_ends_with_its_repeats(program, announced, listener, request):
    process = request.getfixturevalue(program)
    moves = Moves(listener, process)
    assert_a_key_ends_with_its_repeats(process, moves, ANNOUNCED[announced])


def assert_a_key_ends_with_its_repeats(process, moves, announce_at=None):
    """Hold a key, and press one, without their ends."""
    stopwatch = hold(process, 1.4, announce_at)
    assert stopwatch.took(wait_for_end(moves)) <= AFTER_REPEAT
    # And of a press without any: the protocol is known by now.
    process.type(RELEASE)
    moves.times.clear()
    stopwatch = hold(process, 0.0)
    assert stopwatch.took(wait_for_end(moves)) <= AFTER_PRESS
    process.type(RELEASE)
    moves.times.clear()


def test_a_key_that_is_really_held_drives_without_a_gap_and_ends_with_its_release(
    teleop, listener
):
    """On a terminal that announced nothing before, and then does before the press."""
    moves = Moves(listener, teleop)
    assert_a_key_ends_with_its_repeats(teleop, moves)
    teleop.type(ANSWER)
    teleop.wait_for(b'\x1b[>27u')
    assert_a_key_ends_with_its_repeats(teleop, moves)

    stopwatch = Stopwatch(teleop.process.pid)
    hold(teleop, 3.0)
    teleop.type(RELEASE)
    wait_for_end(moves)
    longest = max(b - a for a, b in itertools.pairwise(moves.times))
    assert longest <= 0.15 + stopwatch.waited
