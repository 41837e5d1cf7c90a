# SPDX-License-Identifier: Apache-2.0
import itertools
import math

from cases import for_all
import pytest
from teleop_keyboard.hold import combine
from teleop_keyboard.key_script import parse_key_script
from teleop_keyboard.keymap import Direction
from teleop_keyboard.keymap_file import load_preset
from teleop_keyboard.keys_to_twist import KeysToTwist, STANDSTILL
from teleop_keyboard.parameters import TeleopParameters

# go2.py's motion_map, key -> (x, y, z, th), and its speed_map.
GO2_MOTION = {
    'w': (1, 0, 0, 0),
    'e': (1, 0, 0, -1),
    'a': (0, 1, 0, 0),
    'd': (0, -1, 0, 0),
    'q': (1, 0, 0, 1),
    'x': (-1, 0, 0, 0),
    'c': (-1, 0, 0, 1),
    'z': (-1, 0, 0, -1),
    'r': (0, 0, 0, 1),
    't': (0, 0, 0, -1),
    'f': (1, 1, 0, 0),
    'h': (-1, 1, 0, 0),
    'g': (1, -1, 0, 0),
    'b': (-1, -1, 0, 0),
}
GO2_SPEED = {
    'u': (1.1, 1.0),
    'i': (0.9, 1.0),
    'j': (1.0, 1.1),
    'k': (1.0, 0.9),
    'm': (1.1, 1.1),
    ',': (0.9, 0.9),
}


# teleop_twist_keyboard's moveBindings, key -> (x, y, z, th).
TWIST_KEYBOARD_MOTION = {
    'i': (1, 0, 0, 0),
    'o': (1, 0, 0, -1),
    'j': (0, 0, 0, 1),
    'l': (0, 0, 0, -1),
    'u': (1, 0, 0, 1),
    ',': (-1, 0, 0, 0),
    '.': (-1, 0, 0, 1),
    'm': (-1, 0, 0, -1),
    'O': (1, -1, 0, 0),
    'I': (1, 0, 0, 0),
    'J': (0, 1, 0, 0),
    'L': (0, -1, 0, 0),
    'U': (1, 1, 0, 0),
    '<': (-1, 0, 0, 0),
    '>': (-1, -1, 0, 0),
    'M': (-1, 1, 0, 0),
    't': (0, 0, 1, 0),
    'b': (0, 0, -1, 0),
}


def teleop(preset, **parameters):
    return KeysToTwist(load_preset(preset), TeleopParameters(preset=preset, **parameters))


def hold(logic, keys, seconds, dt=0.02):
    """Hold keys that all repeat at 30 Hz."""
    presses = parse_key_script('0 ' + ' '.join(f'{key}*{round(30 * seconds)}' for key in keys))
    for index in range(round(seconds / dt)):
        while presses and presses[0].time <= index * dt + 1e-9:
            logic.press(presses.pop(0).key)
        logic.step(dt)


def sign(value):
    return 0 if value == 0.0 else math.copysign(1, value)


@for_all('key', GO2_MOTION)
def test_each_motion_key_of_go2_has_its_exact_signs(key):
    logic = teleop('go2')
    hold(logic, [key], 1.5)
    vx, vy, vz, wz = logic.velocity
    x, y, z, turn = GO2_MOTION[key]
    assert (sign(vx), sign(vy), sign(vz), sign(wz)) == (x, y, z, turn)
    assert abs(wz) in (0.0, 0.8)
    # A diagonal is no faster than straight on.
    assert math.hypot(vx, vy) == pytest.approx(0.8 if (x or y) else 0.0)


def test_go2_has_the_keys_of_the_tutorial_and_no_more():
    keymap = load_preset('go2')
    assert dict(keymap.motion) == GO2_MOTION
    assert dict(keymap.speed_keys) == GO2_SPEED
    assert (keymap.speed, keymap.turn) == (0.8, 0.8)


@for_all(('key', 'way'), TWIST_KEYBOARD_MOTION.items())
def test_each_key_of_twist_keyboard_drives_strafes_or_lifts(key, way):
    logic = teleop('twist_keyboard')
    hold(logic, [key], 1.5)
    assert tuple(map(sign, logic.velocity)) == way
    assert math.hypot(*logic.velocity[:3]) == pytest.approx(0.5 if any(way[:3]) else 0.0)


def test_twist_keyboard_has_the_keys_of_ros_2_and_no_more():
    keymap = load_preset('twist_keyboard')
    assert dict(keymap.motion) == TWIST_KEYBOARD_MOTION
    assert set(keymap.speed_keys) == set('qzwxec')
    assert (keymap.speed, keymap.turn) == (0.5, 1.0)


def test_up_counts_with_forward_and_ramps_as_it():
    logic = teleop('twist_keyboard', linear_accel=0.4)
    hold(logic, 'it', 0.5)
    assert logic.velocity.vx == logic.velocity.vz == pytest.approx(0.4 * 0.5)
    hold(logic, 'it', 1.0)
    assert math.hypot(*logic.velocity[:3]) == pytest.approx(0.5)


@for_all('key', GO2_SPEED)
def test_the_speed_keys_of_go2_clamp_two_axes_and_never_move(key):
    logic = teleop('go2')
    for _ in range(200):
        logic.press(key)
        assert logic.step(0.05) is None
    linear, angular = GO2_SPEED[key]
    assert logic.speed == {1.1: 2.0, 1.0: 0.8, 0.9: 0.05}[linear]
    assert logic.turn == {1.1: 2.0, 1.0: 0.8, 0.9: 0.05}[angular]


def test_two_keys_are_an_arc_opposites_cancel_and_diagonals_are_no_faster():
    logic = teleop('wasd')
    hold(logic, 'wd', 1.0)
    assert logic.velocity == (logic.speed, 0.0, 0.0, -logic.turn)
    logic = teleop('wasd')
    hold(logic, 'ws', 1.0)
    assert logic.velocity == STANDSTILL
    logic = teleop('wasd')
    hold(logic, 'wq', 1.0)
    assert logic.velocity.vx == logic.velocity.vy > 0.0
    assert math.hypot(*logic.velocity[:2]) == pytest.approx(logic.speed)


@pytest.mark.slow
def test_the_sum_of_any_directions_stays_within_full_speed():
    ways = [Direction(*way) for way in itertools.product((-1, 0, 1), repeat=4)]
    for first in ways:
        for second in ways:
            both = combine([first, second])
            assert math.hypot(both.x, both.y, both.z) <= 1.0 + 1e-12
            assert abs(both.yaw) <= 1.0
            assert both == combine([second, first])


# Mode, keys with a pause of 2 s after each, shares of full (speed, turn) after each.
MODES = [
    ('hold', 'w', [(0, 0)]),
    ('latch', 'wa', [(1, 0), (0, 1)]),
    ('latch', 'w5', [(1, 0), (0, 0)]),
    ('step', 'wwsa', [(0.1, 0), (0.2, 0), (0.1, 0), (0.1, 0.1)]),
    ('step', 'ww ', [(0.1, 0), (0.2, 0), (0, 0)]),
]


@for_all(('mode', 'keys', 'shares'), MODES)
def test_the_mode_says_how_long_a_key_counts(mode, keys, shares):
    logic = teleop('wasd', mode=mode)
    for key, (speed, turn) in zip(keys, shares, strict=True):
        logic.press(key)
        for _ in range(100):
            logic.step(0.02)
        assert logic.velocity.vx == pytest.approx(speed * logic.speed)
        assert logic.velocity.wz == pytest.approx(turn * logic.turn)


def test_steps_end_at_full_speed():
    logic = teleop('wasd', mode='step', step_share=0.3)
    for _ in range(10):
        logic.press('w')
        logic.step(5.0)
    assert logic.velocity.vx == logic.speed


def test_a_change_of_mode_stops_what_was_latched():
    logic = teleop('wasd', mode='latch')
    logic.press('w')
    logic.set_parameters(TeleopParameters(preset='wasd', mode='hold'))
    assert logic.target == STANDSTILL
