# SPDX-License-Identifier: Apache-2.0
"""Sticks become velocities by the law of teleop_twist_joy, written down here once more."""

from array import array
import math
import random

from cases import for_all
import pytest
from teleop_keyboard.gamepad import JoyState, JoyToTwist, JoyTwist, Pad
from teleop_keyboard.parameters import JoyParameters, PAD_PRESETS

LINEAR, ANGULAR = ('x', 'y', 'z'), ('roll', 'pitch', 'yaw')


class TeleopTwistJoy:
    """The callback of teleop_twist_joy 2.6 on a table of parameters, statement by statement."""

    def __init__(self, values):
        self.values = values
        self.sent_disable_msg = False

    def get_val(self, axes, axis, scale):
        index = self.values.get(axis, -1)
        if index == -1 or len(axes) <= index:
            return 0.0
        return axes[index] * self.values[scale]

    def fill(self, axes, suffix):
        lin = [self.get_val(axes, f'axis_linear.{n}', f'scale_linear{suffix}.{n}') for n in LINEAR]
        ang = [
            self.get_val(axes, f'axis_angular.{n}', f'scale_angular{suffix}.{n}') for n in ANGULAR
        ]
        if lin[0] < 0.0 and self.values['inverted_reverse']:
            ang[2] = -ang[2]
        return (*lin, *ang)

    def callback(self, axes, buttons):
        turbo = self.values['enable_turbo_button']
        enable = self.values['enable_button']
        if turbo >= 0 and len(buttons) > turbo and buttons[turbo]:
            self.sent_disable_msg = False
            return self.fill(axes, '_turbo')
        if not self.values['require_enable_button'] or (len(buttons) > enable and buttons[enable]):
            self.sent_disable_msg = False
            return self.fill(axes, '')
        if not self.sent_disable_msg:
            self.sent_disable_msg = True
            return (0.0,) * 6
        return None


def random_parameters(chance):
    """Return parameters as users call them."""
    values = {
        'require_enable_button': chance.random() < 0.8,
        'enable_button': chance.randrange(8),
        'enable_turbo_button': chance.randrange(-1, 8),
        'inverted_reverse': chance.random() < 0.5,
    }
    for kind, names in (('linear', LINEAR), ('angular', ANGULAR)):
        for name in names:
            values[f'axis_{kind}.{name}'] = chance.randrange(-1, 9)
            for suffix in ('', '_turbo'):
                values[f'scale_{kind}{suffix}.{name}'] = chance.uniform(-3.0, 3.0)
    return values


def random_log(chance, length):
    """Return a log of messages on `joy`: a pad that is played on, and some of other sizes."""
    axes, buttons = [0.0] * 8, [0] * 8
    for _ in range(length):
        axes[chance.randrange(8)] = chance.choice((0.0, 1.0, -1.0, chance.uniform(-1.0, 1.0)))
        buttons[chance.randrange(8)] ^= chance.random() < 0.3
        whole = chance.random() < 0.9
        sizes = (8, 8) if whole else (chance.randrange(9), chance.randrange(9))
        # As the message has them: numbers of 32 bits.
        yield JoyState(tuple(array('f', axes))[: sizes[0]], tuple(buttons)[: sizes[1]])


@for_all('seed', range(20))
def test_a_log_gives_the_same_twists_as_the_published_law(seed):
    chance = random.Random(seed)
    values = random_parameters(chance)
    ours, theirs = JoyToTwist(JoyParameters.from_mapping(values)), TeleopTwistJoy(values)
    twists = 0
    for state in random_log(chance, 500):
        told, law = ours.step(state), theirs.callback(state.axes, state.buttons)
        assert (told is None) == (law is None)
        if told is not None:
            assert told == pytest.approx(law, abs=1e-9, rel=0.0)
            twists += 1
    assert twists > 100


def test_its_defaults_are_those_of_teleop_twist_joy():
    logic = JoyToTwist(PAD_PRESETS['teleop_twist_joy'])
    axes = (0.0, 0.0, 0.5, 0.0, 0.0, 1.0)
    assert logic.step(JoyState(axes, (1,))) == JoyTwist(vx=0.5, wz=0.25)


def test_the_dead_man_button_let_go_is_one_zero():
    logic = JoyToTwist(JoyParameters())
    held, free = (0,) * 4 + (1,), (0,) * 5
    axes = (0.0, 1.0)
    assert logic.step(JoyState(axes, held)) == JoyTwist(vx=0.3)
    assert logic.is_driving
    assert [logic.step(JoyState(axes, free)) for _ in range(3)] == [JoyTwist(), None, None]
    assert not logic.is_driving


@for_all('button', [4, 5])
def test_held_over_a_disarm_a_button_drives_after_it_was_let_go(button):
    logic = JoyToTwist(JoyParameters())
    axes, held = (0.0, 1.0), tuple(int(number == button) for number in range(6))
    assert logic.disarm() is None
    assert logic.step(JoyState(axes, (0,) * 6)) == JoyTwist()
    full = logic.step(JoyState(axes, held))
    assert full.vx > 0.0
    assert logic.disarm() == JoyTwist()
    assert [logic.step(JoyState(axes, held)) for _ in range(3)] == [None] * 3
    assert logic.step(JoyState((0.0, 0.0), held)) is None  # the stick is not the button
    assert logic.step(JoyState(axes, held)) is None
    assert not logic.is_driving
    logic.step(JoyState(axes, (0,) * 6))
    assert logic.step(JoyState(axes, held)) == full


def test_where_no_button_is_needed_sticks_drive_after_a_disarm_when_they_were_at_rest():
    logic = JoyToTwist(JoyParameters(require_enable_button=False))
    # The trigger, axis 2, which drives nothing, rests at 1.
    assert logic.step(JoyState((0.0, 1.0, 1.0), ())) == JoyTwist(vx=0.3)
    assert logic.disarm() == JoyTwist()
    assert [logic.step(JoyState((0.0, x, 1.0), ())) for x in (1.0, 0.5)] == [None, None]
    assert logic.step(JoyState((0.0, 0.0, 1.0), ())) == JoyTwist()
    assert logic.step(JoyState((0.0, 0.5, 1.0), ())) == JoyTwist(vx=0.15)


def test_turbo_is_faster_and_needs_no_other_button():
    logic = JoyToTwist(JoyParameters())
    assert logic.step(JoyState((0.0, 1.0), (0, 0, 0, 0, 0, 1))) == JoyTwist(vx=0.6)


@for_all('bad', [math.nan, math.inf, -math.inf])
def test_a_number_that_is_none_stops_the_robot(bad):
    logic = JoyToTwist(JoyParameters())
    logic.step(JoyState((0.0, 1.0), (0, 0, 0, 0, 1)))
    assert logic.step(JoyState((0.0, bad), (0, 0, 0, 0, 1))) == JoyTwist()
    assert logic.step(JoyState((0.0, bad), (0, 0, 0, 0, 1))) is None


def test_a_pad_that_is_lost_is_one_zero():
    logic = JoyToTwist(JoyParameters())
    logic.step(JoyState((0.0, 1.0), (0, 0, 0, 0, 1)))
    assert logic.lose() == JoyTwist()
    assert logic.lose() is None


def test_the_same_events_give_the_same_twists_again():
    chance = random.Random(5)
    data = b''.join(
        bytes(chance.randrange(256) for _ in range(6)) + bytes((chance.choice((1, 2)), number % 9))
        for number in range(2000)
    )
    runs = []
    for size in (8, 8):
        pad, logic = Pad(), JoyToTwist(PAD_PRESETS['go2'])
        pieces = (data[start:][:size] for start in range(0, len(data), size))
        runs.append([logic.step(state) for piece in pieces for state in pad.take(piece)])
    assert runs[0] == runs[1]
    assert sum(twist is not None for twist in runs[0]) > 200
