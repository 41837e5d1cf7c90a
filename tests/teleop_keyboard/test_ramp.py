# SPDX-License-Identifier: Apache-2.0
import math

from cases import for_all
import pytest
from teleop_keyboard.keymap_file import load_preset
from teleop_keyboard.keys_to_twist import KeysToTwist, Pace, ramped_twist, STANDSTILL, Velocity
from teleop_keyboard.parameters import TeleopParameters


def pace(**changes):
    values = {
        'linear_accel': 1.0,
        'angular_accel': 2.0,
        'linear_decel': 3.0,
        'angular_decel': 4.0,
        'linear_stop': 5.0,
        'angular_stop': 6.0,
    }
    return Pace(**{**values, **changes})


@for_all(
    ('previous', 'target', 'reached'),
    [
        (STANDSTILL, Velocity(1, -1, 0.5, 1), (0.1, -0.1, 0.1, 0.2)),  # speeding up
        # Slowing down, stopping, reversing.
        (Velocity(1, -1, 1, 1), Velocity(0.5, -0.5, 0.5, 0.5), (0.7, -0.7, 0.7, 0.6)),
        (Velocity(1, -1, -1, 1), STANDSTILL, (0.5, -0.5, -0.5, 0.4)),
        (Velocity(1, 0, 1, 0), Velocity(-1, 0, -1, 0), (0.7, 0, 0.7, 0)),
        # To zero in 0.05 s at 3 m/s^2, then 0.05 s of speeding up.
        (Velocity(vx=0.15), Velocity(vx=-1), (-0.05, 0, 0, 0)),
        (Velocity(vx=0.05), Velocity(vx=0.1), (0.1, 0, 0, 0)),  # arriving
    ],
)
def test_each_axis_speeds_up_slows_down_and_stops_at_its_own_pace(previous, target, reached):
    assert ramped_twist(previous, target, pace(), 0.1) == pytest.approx(reached)


def test_keeping_the_direction_keeps_the_path():
    velocity, target = STANDSTILL, Velocity(0.4, 0.1, -0.2, 1.0)
    even = pace(keep_direction=True)
    for _ in range(39):
        velocity = ramped_twist(velocity, target, even, 0.01)
        assert velocity.wz / velocity.vx == pytest.approx(target.wz / target.vx)
        assert velocity.vy / velocity.vx == pytest.approx(target.vy / target.vx)
        assert velocity.vz / velocity.vx == pytest.approx(target.vz / target.vx)
    # As fast as the slowest axis: wz to 1 at 2 rad/s^2 takes 0.5 s, vx to 0.4 takes 0.4 s.
    assert velocity.wz == pytest.approx(0.39 * 2.0)
    for _ in range(20):
        velocity = ramped_twist(velocity, target, even, 0.01)
    assert velocity == target


def test_no_time_changes_nothing_and_much_time_arrives():
    for keep in (False, True):
        ramps = pace(keep_direction=keep)
        start, target = Velocity(0.3, -0.2, 0.2, 0.1), Velocity(-0.3, 0.2, 0.0, 0.5)
        assert ramped_twist(start, target, ramps, 0.0) == start
        assert ramped_twist(start, target, ramps, 1e3) == target


@for_all('cadence', [10, 30, 100])
def test_slopes_by_parameter_are_kept_at_any_cadence_and_a_stop_key_bypasses_them(cadence):
    parameters = TeleopParameters(linear_accel=0.4, linear_stop=0.8)
    logic = KeysToTwist(load_preset('mbot'), parameters)
    speeds = []
    for index in range(300):
        if index % (1000 // cadence) == 0:
            logic.press('i')
        logic.step(0.001)
        speeds.append(logic.velocity.vx)
    assert (speeds[250] - speeds[50]) / 0.2 == pytest.approx(0.4, rel=0.01)
    logic.press('x')
    logic.press('P')  # any other key: to a stop, on the ramp
    before = logic.velocity.vx
    logic.step(0.05)
    assert before - logic.velocity.vx == pytest.approx(0.8 * 0.05, rel=0.01)
    logic.press('k')
    assert logic.velocity == STANDSTILL
    assert math.isclose(logic.speed, 0.2 * 0.9)
