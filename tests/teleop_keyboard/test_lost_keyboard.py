# SPDX-License-Identifier: Apache-2.0
"""A robot whose keyboard is gone stops: in another process, on another host, killed outright."""

import signal

from cases import for_all
import pytest
from teleop_keyboard.keymap_file import load_preset
from teleop_keyboard.keys_to_twist import KeysToTwist, STANDSTILL
from teleop_keyboard.parameters import TeleopParameters
from teleop_keyboard.twist_messages import from_twist
from terminals import Stopwatch

STEP = 0.01
KEYS = ('-m', 'teleop_keyboard.key_publisher_node')


# A key that is not heard of again: in mode hold it ends when it should have repeated, at 0.6 s.
@for_all(('mode', 'learnt'), [('hold', 0.6), ('latch', 1e9), ('step', 1e9)])
@for_all('timeout', [0.3, 0.5, 2.0])
def test_no_key_counts_longer_than_the_time_out_in_any_mode(mode, learnt, timeout):
    logic = KeysToTwist(load_preset('mbot'), TeleopParameters(mode=mode, key_timeout=timeout))
    logic.press('i')
    elapsed = 0.0
    while logic.target != STANDSTILL:
        logic.step(STEP)
        elapsed += STEP
    assert elapsed == pytest.approx(min(timeout, learnt))


def test_a_key_whose_release_will_be_told_ends_with_the_time_out_too():
    logic = KeysToTwist(load_preset('mbot'), TeleopParameters(key_timeout=0.25))
    for _ in range(10):
        logic.press('HELD+i')
        logic.step(0.1)
        assert logic.target.vx == 0.2
    logic.step(0.15)
    assert logic.target == STANDSTILL


def test_a_repeating_key_drives_on_past_the_time_out():
    logic = KeysToTwist(load_preset('mbot'), TeleopParameters(key_timeout=0.55))
    for index in range(200):
        if index == 0 or (index >= 50 and index % 3 == 0):
            logic.press('i')
        assert logic.target.vx == 0.2
        logic.step(STEP)


def test_without_a_time_out_a_latched_key_counts_for_ever():
    logic = KeysToTwist(load_preset('ramps'), TeleopParameters())
    logic.press('w')
    logic.step(1e6)
    assert logic.target.vx == 0.5


@pytest.mark.slow
@pytest.mark.parametrize(('preset', 'key'), [('mbot', b'i'), ('ramps', b'w')])
def test_a_killed_keyboard_is_a_zero_within_the_time_out(
    pty_process, stamped_listener, background, preset, key
):
    listener, timeout = stamped_listener, 0.5
    driver = background(
        'teleop_keyboard.keys_to_twist_node',
        *f'--ros-args -p preset:={preset} -p stamped:=true -p key_timeout:={timeout}'.split(),
        # No ramp: the zero itself is timed. It may come a period of `ramps`' 20 Hz later.
        *['-p', 'idle:=silent', '-p', 'linear_accel:=1000.0', '-p', 'linear_stop:=1000.0'],
    )
    process = pty_process(*KEYS)
    listener.probe(process)
    listener.drive(process, key)
    listener.twists.clear()
    process.process.send_signal(signal.SIGKILL)
    stopwatch = Stopwatch(driver.pid)
    listener.wait_for_twist(lambda velocity: velocity == STANDSTILL)
    first = next(m for m in listener.twists if from_twist(m) == STANDSTILL)
    sent = first.header.stamp.sec + 1e-9 * first.header.stamp.nanosec
    # A key typed just before may still be on its way: 0.1 s for it.
    assert stopwatch.took(sent) <= timeout + 1 / 20 + 0.1
    assert sent > stopwatch.began
    listener.settle()
    assert from_twist(listener.twists[-1]) == STANDSTILL


@pytest.mark.slow
def test_a_keyboard_that_leaves_stops_a_robot_that_would_drive_for_ever(
    pty_process, listener, background
):
    arguments = '--ros-args -p preset:=ramps -p idle:=silent'
    background('teleop_keyboard.keys_to_twist_node', *arguments.split())
    process = pty_process(*KEYS)
    listener.probe(process)
    listener.drive(process, b'w')
    process.type(b'\x03')
    assert process.wait() == 0
    listener.wait_for_twist(lambda velocity: velocity == STANDSTILL)
