# SPDX-License-Identifier: Apache-2.0
"""
How soon a robot is told to stop when a key is released, counted in what is published.

The ramp to a stop is as good as none here (`linear_stop`), so the zero itself is what is timed;
with a preset's ramp it is the start of the ramp that comes then.
"""

import time

from cases import for_all
import pytest
from teleop_keyboard.key_script import parse_key_script
from teleop_keyboard.keymap_file import load_preset
from teleop_keyboard.keys_to_twist import KeysToTwist, STANDSTILL
from teleop_keyboard.parameters import TeleopParameters
from teleop_keyboard.twist_messages import from_twist

# The step and the period of the messages of a node of its own [s].
STEP = 0.02
NO_RAMP = {'linear_accel': 1000.0, 'linear_stop': 1000.0}


def published(events, end, **parameters):
    """Step mbot's keymap; return (time [s], velocity) of all messages."""
    logic = KeysToTwist(load_preset('mbot'), TeleopParameters(**parameters))
    waiting, messages = list(events), []
    for index in range(1, round(end / STEP)):
        while waiting and waiting[0][0] <= index * STEP:
            logic.press(waiting.pop(0)[1])
        velocity = logic.step(STEP)
        if velocity is not None:
            messages.append((index * STEP, velocity))
    return messages


def told_hold(start, end):
    """Return the names that a terminal which tells releases gives for a held key."""
    held = [(start + 0.1 * n, 'HELD+i') for n in range(round((end - start) / 0.1))]
    return [(start, 'i'), *held, (end, 'RELEASE+i')]


@for_all('held', [0.005, 0.03, 0.1, 0.37, 2.0])
def test_a_told_release_is_a_zero_within_50_ms(held):
    messages = published(told_hold(0.1, 0.1 + held), 4.0, **NO_RAMP)
    zeros = [when for when, velocity in messages if velocity == STANDSTILL]
    assert len(zeros) == 1
    assert 0.0 <= zeros[0] - (0.1 + held) <= 0.05
    assert messages[-1][1] == STANDSTILL  # and silence after it


def test_with_the_ramp_of_a_preset_a_told_release_brakes_within_50_ms():
    messages = published(told_hold(0.1, 1.1), 4.0)
    slower = next(when for when, velocity in messages if when > 1.0 and velocity.vx < 0.2)
    assert slower - 1.1 <= 0.05
    # 0.2 m/s at 0.6 m/s^2; a step more for where in a step the release fell.
    assert messages[-1][0] - 1.1 <= 0.2 / 0.6 + 2 * STEP


@for_all('delay', [0.25, 0.5])
def test_a_key_that_repeats_shows_no_zero_until_150_ms_after_its_last_repeat(delay):
    repeats = [0.1 + delay + index / 30 for index in range(30)]
    messages = published([(when, 'i') for when in [0.1, *repeats]], 4.0, **NO_RAMP)
    zeros = [when for when, velocity in messages if velocity == STANDSTILL]
    assert len(zeros) == 1
    assert 0.0 < zeros[0] - repeats[-1] <= 0.15
    # Nor a pause: a message every period from the first press to the zero.
    times = [when for when, _ in messages]
    gaps = [after - before for before, after in zip(times, times[1:], strict=False)]
    assert max(gaps) == pytest.approx(STEP)


@pytest.mark.slow
def test_on_a_terminal_that_tells_releases_it_takes_50_ms(pty_process, stamped_listener, tmp_path):
    """By the process's own clock: stamps of its messages, times of its saved keys."""
    listener, saved = stamped_listener, tmp_path / 'saved.keys'
    parameters = [f'-p {name}:={value}'.split() for name, value in NO_RAMP.items()]
    process = pty_process(
        *('-m', 'teleop_keyboard.teleop_node', '--save-keys', str(saved), '--ros-args'),
        *('-p', 'stamped:=true', *[word for pair in parameters for word in pair]),
        environment={'TERM': 'xterm-kitty'},
    )
    # The test is the terminal: it is asked, answers, and is told to tell all.
    process.wait_for(b'\x1b[?u')
    process.type(b'\x1b[?0u')
    process.wait_for(b'\x1b[>27u')
    listener.probe(
        process,
        sequence=b'\x1b[112;;112u\x1b[112;1:3u',
        names={'p', 'RELEASE+p', 'y'},
        last=(b'\x1b[121;;121u\x1b[121;1:3u', 'RELEASE+y'),
    )
    starts = len(parse_key_script(saved.read_text()))
    for hold in (0.1, 0.3, 0.5):
        process.type(b'\x1b[105;;105u')
        time.sleep(hold)
        process.type(b'\x1b[105;1:3u')
        listener.settle(0.2)
    process.type(b'\x1b[99;5u')
    assert process.wait() == 0
    process.wait_for(b'\x1b[<u')
    assert process.attributes == process.before

    presses = parse_key_script(saved.read_text())[starts:]
    assert [press.key for press in presses if press.key[:4] != 'HELD'] == ['i', 'RELEASE+i'] * 3
    pressed = [press.time for press in presses if press.key == 'i']
    released = [press.time for press in presses if press.key == 'RELEASE+i']
    twists = [(stamp(message), from_twist(message)) for message in listener.twists]
    motions = split_after_zeros(twists)
    # Three motions, each to one zero; then the zeros of the end.
    assert len(motions) >= 3
    delays = []
    for motion, start, end in zip(motions, pressed, released, strict=False):
        assert {velocity.vx for _, velocity in motion[:-1]} == {0.2}
        delays.append((motion[-1][0] - motion[0][0]) - (end - start))
    # The best of three: a busy machine adds to a delay, but never takes from it.
    assert min(delays) <= 0.05


def stamp(message):
    """Return the time of a message [s]."""
    return message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec


def split_after_zeros(twists):
    """Return the motions: messages up to and with their first zero."""
    motions, motion = [], []
    for when, velocity in twists:
        motion.append((when, velocity))
        if velocity == STANDSTILL:
            if len(motion) > 1:
                motions.append(motion)
            motion = []
    return motions
