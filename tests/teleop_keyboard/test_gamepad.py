# SPDX-License-Identifier: Apache-2.0
"""Events of a joystick device become states: none lost, none that nobody pressed."""

from array import array

from cases import for_all
from pads import AXIS, BUTTON, event, FULL, INIT
import pytest
from teleop_keyboard.gamepad import controls_of, JoyState, Pad, PadKeys
from teleop_keyboard.parameters import JoyParameters, PAD_PRESETS
from wasd_core.parameters import InvalidParameter

FIRST = event(AXIS | INIT, 0, 0) + event(BUTTON | INIT, 0, 0) + event(BUTTON | INIT, 1, 0)


@pytest.fixture
def pad():
    pad = Pad(deadzone=0.05)
    pad.take(FIRST)
    return pad


@pytest.mark.parametrize(
    ('raw', 'told'),
    [
        (0, 0.0),
        (round(0.05 * FULL), 0.0),
        (-round(0.05 * FULL), 0.0),
        (FULL, -1.0),
        (-FULL, 1.0),
        (-FULL - 1, 1.0),
        # joy_linux: (value - zone) / (1 - 0.05) / 32767, left and up positive.
        (20000, -(20000 - 0.05 * FULL) / 0.95 / FULL),
        (-20000, (20000 - 0.05 * FULL) / 0.95 / FULL),
    ],
)
def test_an_axis_grows_from_the_edge_of_the_dead_zone_to_one(pad, raw, told):
    pad.take(event(AXIS, 0, raw))
    assert pad.state.axes == (array('f', [told])[0],)


def test_each_press_and_each_release_is_told_and_axes_are_told_together(pad):
    events = [
        event(AXIS, 0, FULL),
        event(AXIS, 1, FULL),
        event(BUTTON, 0, 1),
        event(BUTTON, 0, 0),
        event(AXIS, 1, -FULL),
        event(AXIS, 0, -FULL),
    ]
    assert pad.take(b''.join(events)) == [
        JoyState((-1.0, -1.0), (1, 0)),
        JoyState((-1.0, -1.0), (0, 0)),
        JoyState((1.0, 1.0), (0, 0)),
    ]


def test_events_may_come_in_pieces_of_any_size():
    data = FIRST + event(BUTTON, 1, 1) + event(AXIS, 0, FULL) + event(BUTTON, 1, 0)
    whole = Pad()
    whole.take(data)
    for size in range(1, 20):
        pad, presses = Pad(), 0
        for start in range(0, len(data), size):
            presses += any(state.buttons[1:] == (1,) for state in pad.take(data[start:][:size]))
        assert pad.state == whole.state
        assert presses >= 1


def test_a_button_that_is_down_when_the_pad_comes_counts_from_its_next_press_on():
    pad = Pad()
    pad.take(event(BUTTON | INIT, 0, 1))
    assert pad.state.buttons == (0,)
    pad.take(event(BUTTON, 0, 1))  # still never seen up
    assert pad.state.buttons == (0,)
    pad.take(event(BUTTON, 0, 0) + event(BUTTON, 0, 1))
    assert pad.state.buttons == (1,)


def test_what_the_kernel_tells_again_after_it_lost_events_is_the_state(pad):
    pad.take(event(BUTTON, 0, 1) + event(AXIS, 0, FULL))
    pad.take(event(BUTTON | INIT, 0, 1) + event(BUTTON | INIT, 1, 1) + event(AXIS | INIT, 0, 0))
    # Button 1 was never seen going down.
    assert pad.state == JoyState((0.0,), (1, 0))
    pad.take(event(BUTTON | INIT, 0, 0))
    assert pad.state.buttons == (0, 0)


def test_let_go_it_stands_until_buttons_were_seen_up(pad):
    pad.take(event(BUTTON, 0, 1) + event(AXIS, 0, FULL))
    pad.let_go()
    assert pad.state == JoyState((0.0,), (0, 0))
    pad.take(event(AXIS, 0, FULL) + event(BUTTON, 1, 1))
    assert pad.state == JoyState((-1.0,), (0, 1))
    pad.take(event(BUTTON, 0, 0) + event(BUTTON, 0, 1))
    assert pad.state.buttons == (1, 1)


def test_events_of_other_kinds_are_passed_over(pad):
    before = pad.state
    assert pad.take(event(0x04, 0, 1) + event(0x00, 3, 7)) == []
    assert pad.state == before


def keys_of(*states, bindings=PAD_PRESETS['go2'].keys):
    """Return the keys that each of some states presses; names stand for what is down."""
    keys = PadKeys(bindings)
    told = []
    for down in states:
        buttons = [0] * 11
        axes = [0.0] * 8
        for name in down.split():
            button, axis = keys.controls[name]
            if button >= 0:
                buttons[button] = 1
            else:
                axes[axis] = -1.0
        told.append(keys.step(JoyState(tuple(axes), tuple(buttons))))
    return told


def test_the_go2_preset_is_unitrees_remote():
    assert keys_of('', 'L2', 'L2 A', 'L2', 'L2 B', '', 'START') == [
        [], [], ['2'], [], ['1'], [], ['5'],
    ]  # fmt: skip


def test_a_chord_needs_the_button_last_and_the_others_held():
    assert keys_of('', 'A', 'A L2', 'L2', '', 'A') == [[], [], [], [], [], []]


def test_what_is_down_at_first_presses_nothing():
    assert keys_of('START', 'START', '', 'START') == [[], [], [], ['5']]


def test_the_longer_chord_counts():
    bindings = ('A=x', 'L1+A=y', 'L1+R1+A=z')
    assert keys_of('', 'A', 'L1', 'L1 A', 'L1 R1', 'L1 R1 A', bindings=bindings) == [
        [], ['x'], [], ['y'], [], ['z'],
    ]  # fmt: skip


def test_a_pad_that_says_what_its_buttons_are_is_believed():
    # hid-playstation: cross, circle, triangle, square, L1, R1, L2, R2, share, options, PS.
    codes = [0x130, 0x131, 0x133, 0x134, 0x136, 0x137, 0x138, 0x139, 0x13A, 0x13B, 0x13C]
    controls = controls_of([0, 1, 2, 3, 4, 5], codes)
    assert controls['START'] == (9, -1)
    assert controls['L2'] == (6, 2)
    assert controls_of([], [])['A'] == (-1, -1)


@for_all('text', ['A', 'A=', '=2', 'Q=2', 'L2+=2', 'L9+A=2'])
def test_a_binding_that_means_nothing_is_refused(text):
    with pytest.raises(InvalidParameter, match='^keys: '):
        PadKeys((text,))


def test_every_preset_has_keys_that_mean_something_and_a_dead_man_button():
    for preset in PAD_PRESETS.values():
        PadKeys(preset.keys)
        assert preset.require_enable_button
        assert preset.enable_button >= 0
    assert PAD_PRESETS['mbot'] == JoyParameters()
