# SPDX-License-Identifier: Apache-2.0
"""
The board's integer law against sequences worked out by hand.

A frame adds trunc((Kp e + Kd (e - e') + Ki S) / Ko) to the PWM, e being what the set-point has
more than the ticks of the frame, e' the one before and S the sum of the errors up to e'.
"""

import math

from cases import for_all
from diff_drive_sim.arbotix import ArbotixFirmware, divide_like_c, int16, setpoints_of
from diff_drive_sim.wheel_loop import Gains
import pytest

COURSE = Gains(12, 12, 0, 50)
FRAME = 34


def left_pwm(gains, setpoint, ticks, start=0):
    """Return the left PWM after each frame with these ticks; armed at `start`."""
    board = ArbotixFirmware(gains)
    board.write(setpoint, setpoint, start, start)
    found = []
    for index, count in enumerate(ticks):
        board.update(1 + FRAME * index, count, count)
        found.append(board.pwm[0])
    return found


def test_a_blocked_wheel_gets_more_each_frame():
    # e = 27: (324 + 324) / 50 = 12.96, then 324 / 50 = 6.48 each.
    assert left_pwm(COURSE, 27, [0] * 5) == [12, 18, 24, 30, 36]


def test_both_directions_are_alike_for_division_goes_towards_zero():
    assert left_pwm(COURSE, -27, [0] * 5) == [-12, -18, -24, -30, -36]


def test_pwm_ends_at_255():
    # 12 + 6 * 40 = 252 in frame 41.
    pwm = left_pwm(COURSE, 27, [0] * 44)
    assert pwm[40:] == [252, 255, 255, 255]


@for_all(('setpoint', 'pwm'), [(4, 1), (-4, -1)])
def test_four_ticks_missing_are_four_too_few_to_be_noticed(setpoint, pwm):
    # (48 + 48) / 50 = 1.92, then 48 / 50 = 0.96, for ever.
    assert left_pwm(COURSE, setpoint, [0] * 9) == [pwm] * 9


def test_a_moving_wheel():
    # e = 7: (84 + 84) / 50 = 3.36; e = 4: (48 - 36) / 50 = 0.24; e = -1: (-12 - 60) / 50 = -1.44.
    assert left_pwm(COURSE, 10, [3, 9, 20]) == [3, 3, 2]


def test_the_sum_is_of_the_errors_before_and_stops_where_pwm_is_full():
    # S: 0, 100, 200; then 100 + 200 = 300 is cut to 255 and S stays.
    assert left_pwm(Gains(0, 0, 10, 10), 100, [0] * 4) == [0, 100, 255, 255]
    # Going back, e = -300: S = 200 adds once more, at the limit; S still stays.
    board = ArbotixFirmware(Gains(0, 0, 10, 10))
    board.write(100, 100, 0, 0)
    for index, ticks in enumerate([0, 0, 0, 400, 400]):
        board.update(1 + FRAME * index, ticks, ticks)
    assert board.pwm == (255, 255)


def test_the_product_with_the_sum_has_16_bits():
    # 255 * 200 = 51000 is -14536 in 16 bits; / 255 = -57.004.
    assert left_pwm(Gains(0, 0, 255, 255), 200, [0] * 2) == [0, -57]


@for_all(('value', 'kept'), [(32767, 32767), (32768, -32768), (-32769, 32767)])
def test_16_bits_wrap(value, kept):
    assert int16(value) == kept


@for_all('value', range(-120, 121, 7))
def test_division_is_that_of_c(value):
    assert divide_like_c(value, 50) == math.trunc(value / 50)


def test_both_at_zero_cut_the_motors_at_once_and_forget():
    board = ArbotixFirmware(COURSE)
    board.write(27, 27, 0, 0)
    board.update(1, 0, 0)
    assert board.pwm == (12, 12)
    board.write(0, 0, 0, 0)
    assert board.pwm == (0, 0)
    board.update(100, 0, 0)
    assert board.pwm == (0, 0)
    # Armed anew, from where the encoders are by now: 3 of 10 ticks in the frame, (84 + 84) / 50.
    board.write(10, 10, 50, 60)
    board.update(200, 53, 63)
    assert board.pwm == (3, 3)


def test_one_wheel_at_zero_is_controlled_on():
    board = ArbotixFirmware(COURSE)
    board.write(27, 27, 0, 0)
    board.update(1, 0, 0)
    board.write(27, 0, 0, 0)
    # Right: e = 0 after 27: (0 - 324) / 50 = -6.48.
    board.update(35, 0, 0)
    assert board.pwm == (18, 6)


def test_a_new_set_point_while_moving_does_not_base_anew():
    board = ArbotixFirmware(COURSE)
    board.write(10, 10, 0, 0)
    board.write(20, 20, 5, 5)
    board.update(1, 5, 5)  # e = 15, not 20: (180 + 180) / 50 = 7.2
    assert board.pwm == (7, 7)


def test_a_frame_is_34_milliseconds():
    board = ArbotixFirmware(COURSE)
    board.write(27, 27, 0, 0)
    changes = []
    for milliseconds in range(1, 110):
        before = board.pwm
        board.update(milliseconds, 0, 0)
        if board.pwm != before:
            changes.append(milliseconds)
    assert changes == [1, 35, 69, 103]


@for_all(
    ('velocity', 'setpoints'),
    [
        ((0.5, 0.0), (68, 68)),  # 68.33
        ((-0.5, 0.0), (-68, -68)),
        ((0.05, 0.0), (6, 6)),  # 6.83
        ((0.3, 0.0), (41, 41)),
        ((0.0, 1.0), (-17, 17)),  # 0.13 m/s: 17.77
        ((0.007, 0.0), (0, 0)),  # less than a tick
        ((1e308, 0.0), (32767, 32767)),  # the most that 16 bits hold
        ((-1e300, 1e308), (-32767, 32767)),
    ],
)
def test_set_points_are_whole_ticks_in_a_thirtieth_of_a_second(velocity, setpoints):
    assert setpoints_of(*velocity, 0.26, 4100.0) == setpoints


@for_all(('wanted', 'reached'), [(0.05, 0.0275), (0.1, 0.0745), (0.2, 0.180), (0.5, 0.477)])
def test_speeds_it_settles_at_are_those_of_its_dead_band(wanted, reached):
    # A motor of first order: 1 m/s at full PWM, time constant 0.1 s. What it settles at depends
    # on how frames fall; a PWM step is 1/255 m/s.
    board = ArbotixFirmware(COURSE)
    board.write(*setpoints_of(wanted, 0.0, 0.38, 4100.0), 0, 0)
    speed = path = late = 0.0
    for milliseconds in range(1, 12001):
        ticks = math.floor(path * 4100.0)
        board.update(milliseconds, ticks, ticks)
        speed += (board.pwm[0] / 255.0 - speed) * (1.0 - math.exp(-0.01))
        path += 0.001 * speed
        if milliseconds > 10000:
            late += speed / 2000.0
    assert late == pytest.approx(reached, abs=1.01 / 255.0)
    assert late < 0.96 * wanted
