# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
import math

from cases import for_all
from diff_drive_sim.odometry import BELIEVABLE, OdometryState, SMALLEST_JUMP, WheelOdometry
import pytest


@pytest.fixture
def odometry(geometry):
    odometry = WheelOdometry(geometry)
    odometry.step(0.0, 0.0, 0.005)
    return odometry


def drive(odometry, geometry, linear, angular, duration, rate=200.0):
    """Turn the wheels as a constant twist [m/s], [rad/s] does; return the last state."""
    left, right = geometry.wheel_speeds(linear, angular)
    start_left, start_right = odometry._angles
    state = odometry.state
    for index in range(1, round(duration * rate) + 1):
        t = index / rate
        state = odometry.step(start_left + left * t, start_right + right * t, 1.0 / rate)
    return state


@pytest.mark.parametrize('linear', [0.5, -0.2])
def test_straight_ahead_is_speed_times_time(odometry, geometry, linear):
    state = drive(odometry, geometry, linear, 0.0, 4.0)
    assert (state.x, state.y, state.yaw) == pytest.approx((4.0 * linear, 0.0, 0.0), abs=1e-12)
    assert (state.linear, state.angular) == pytest.approx((linear, 0.0), abs=1e-9)


@pytest.mark.parametrize('rate', [5.0, 50.0, 200.0])
@pytest.mark.parametrize(('linear', 'angular'), [(0.5, 1.0), (0.3, -0.7), (-0.4, 0.2)])
def test_an_arc_is_exact_at_any_rate(odometry, geometry, linear, angular, rate):
    duration = 2.0
    state = drive(odometry, geometry, linear, angular, duration, rate)
    turn, radius = angular * duration, linear / angular
    assert state.x == pytest.approx(radius * math.sin(turn), abs=1e-12)
    assert state.y == pytest.approx(radius * (1.0 - math.cos(turn)), abs=1e-12)
    assert state.yaw == pytest.approx(turn, abs=1e-12)
    assert (state.linear, state.angular) == pytest.approx((linear, angular), abs=1e-9)


def test_a_half_circle_of_1_m_is_off_by_less_than_a_tenth_of_a_millimetre(odometry, geometry):
    # arbotix: 152 mm off, with Euler steps 51 mm (both at 10 Hz).
    state = drive(odometry, geometry, 0.5, 1.0, math.pi)
    turn = 1.0 * round(math.pi * 200.0) / 200.0  # the circle ends with a whole step
    end = (0.5 * math.sin(turn), 0.5 * (1.0 - math.cos(turn)))
    assert math.hypot(state.x - end[0], state.y - end[1]) < 1e-4


@pytest.mark.parametrize('angular', [2.0, -2.0])
def test_on_the_spot_only_the_heading_turns_and_is_continuous(odometry, geometry, angular):
    state = drive(odometry, geometry, 0.0, angular, 10.0)
    assert (state.x, state.y) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert state.yaw == pytest.approx(10.0 * angular)  # beyond a full turn


def test_there_and_back_is_where_it_began(odometry, geometry):
    drive(odometry, geometry, 0.4, 0.9, 3.0)
    state = drive(odometry, geometry, -0.4, -0.9, 3.0)
    assert (state.x, state.y, state.yaw) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize('turn', [0.9e-4, 1.1e-4])
def test_the_series_for_small_turns_meets_the_quotient(geometry, turn):
    odometry = WheelOdometry(geometry)
    odometry.step(0.0, 0.0, 1.0)
    left, right = geometry.wheel_speeds(1.0, 2.0 * turn)
    state = odometry.step(left, right, 1.0)
    assert state.x == pytest.approx(math.sin(2.0 * turn) / (2.0 * turn), rel=1e-15)


def test_encoders_that_do_not_start_at_zero_move_nothing(geometry):
    odometry = WheelOdometry(geometry)
    assert odometry.step(123.0, -45.0, 0.005) == OdometryState()
    state = odometry.step(123.0 + 1.0, -45.0 + 1.0, 0.005)
    assert (state.x, state.y, state.yaw) == pytest.approx((0.06, 0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize('bad', [math.nan, math.inf])
def test_an_angle_that_is_not_finite_changes_nothing_and_is_caught_up(odometry, geometry, bad):
    left, _ = geometry.wheel_speeds(0.6, 0.0)
    before = odometry.step(left * 0.005, left * 0.005, 0.005)
    assert odometry.step(bad, left * 0.010, 0.005) == before
    after = odometry.step(left * 0.015, left * 0.015, 0.005)
    assert after.x == pytest.approx(0.6 * 0.015)
    # Two periods have passed: no spike in the speed.
    assert after.linear == pytest.approx(0.6)


def test_without_time_passing_the_speed_stays(odometry, geometry):
    drive(odometry, geometry, 0.5, 0.0, 0.1)
    angle = odometry._angles[0]
    state = odometry.step(angle, angle, 0.0)
    assert state.linear == pytest.approx(0.5)
    assert math.isfinite(state.angular)


def test_a_reset_begins_anew_with_the_encoders_where_they_are(odometry, geometry):
    drive(odometry, geometry, 0.5, 1.0, 1.0)
    angles = odometry._angles
    odometry.reset()
    assert odometry.step(*angles, 0.005) == OdometryState()


@pytest.mark.parametrize('linear', [0.0, 0.3])
def test_a_base_beside_the_axle_is_carried_around_it(geometry, linear):
    # In the base frame the axle is at (0.09, -0.02): p_base = p_axle - R(yaw) (0.09, -0.02).
    x, y, angular, duration = 0.09, -0.02, 0.8, 2.0
    geometry = replace(geometry, axle_x=x, axle_y=y)
    odometry = WheelOdometry(geometry)
    odometry.step(0.0, 0.0, 0.005)
    state = drive(odometry, geometry, linear, angular, duration)
    turn, radius = angular * duration, linear / angular
    sin, cos = math.sin(turn), math.cos(turn)
    axle = x + radius * sin, y + radius * (1.0 - cos)
    assert state.yaw == pytest.approx(turn, abs=1e-12)
    assert state.x == pytest.approx(axle[0] - (cos * x - sin * y), abs=1e-12)
    assert state.y == pytest.approx(axle[1] - (sin * x + cos * y), abs=1e-12)
    # v_base = v_axle + omega x (base - axle), in the base frame.
    twist = (state.linear, state.lateral, state.angular)
    assert twist == pytest.approx((linear + angular * y, -angular * x, angular), abs=1e-9)


def test_encoders_that_restart_move_nothing_and_give_no_spike(geometry):
    odometry = WheelOdometry(geometry)
    odometry.speed_limit = 25.0
    odometry.step(0.0, 0.0, 0.02)
    before = drive(odometry, geometry, 0.5, 0.4, 10.0, rate=50.0)
    after = odometry.step(0.0, 0.0, 0.02)
    assert (after.x, after.y, after.yaw) == (before.x, before.y, before.yaw)
    assert (after.linear, after.angular) == (0.0, 0.0)
    assert odometry.restarts == 1
    # From there on it counts again.
    ahead = drive(odometry, geometry, 0.5, 0.0, 1.0, rate=50.0)
    assert math.hypot(ahead.x - after.x, ahead.y - after.y) == pytest.approx(0.5)
    assert odometry.restarts == 1


@for_all('sign', [1.0, -1.0])
@for_all('dt', [0.0, 0.005, 0.02, 3.0])
def test_what_a_pushed_wheel_can_do_is_believed_at_any_interval(geometry, sign, dt):
    largest = max(SMALLEST_JUMP, BELIEVABLE * 25.0 * dt)
    for change, moves in ((0.99 * largest, True), (1.01 * largest, False)):
        odometry = WheelOdometry(geometry)
        odometry.speed_limit = 25.0
        odometry.step(5.0, 5.0, 0.005)
        state = odometry.step(5.0 + sign * change, 5.0 + sign * change, dt)
        assert state.x == pytest.approx(sign * change * 0.06 if moves else 0.0, abs=1e-12)
