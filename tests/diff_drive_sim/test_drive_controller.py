# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
import math

from diff_drive_sim.drive import DiffDriveController
from diff_drive_sim.limits import Velocity
from diff_drive_sim.odometry import OdometryState
from diff_drive_sim.parameters import DiffDriveParameters
import numpy as np
import pytest

DT = 0.005
LIMITS = DiffDriveParameters(
    linear_max_velocity=0.8,
    angular_max_velocity=3.0,
    linear_max_acceleration=0.5,
    angular_max_acceleration=2.0,
    cmd_vel_timeout=0.5,
)


@pytest.fixture
def controller(geometry):
    return DiffDriveController(geometry, LIMITS)


def run(controller, duration, dt=DT):
    """Step for a duration [s] and return the velocities on the way."""
    velocities = []
    for _ in range(round(duration / dt)):
        controller.step(0.0, 0.0, dt)
        velocities.append(controller.velocity)
    return velocities


def test_without_a_command_it_stands_still(controller):
    assert controller.step(0.0, 0.0, DT) == (0.0, 0.0)
    assert controller.state == 'stopped'


@pytest.mark.parametrize(('linear', 'angular'), [(0.3, 0.0), (0.0, 1.0), (0.2, -0.7)])
def test_wheel_speeds_add_up_to_the_command(controller, geometry, linear, angular):
    controller.command(linear, angular)
    run(controller, 0.45)
    controller.command(linear, angular)
    run(controller, 0.45)
    left, right = controller.step(0.0, 0.0, DT)
    forward, turn = geometry.displacement(left, right)
    assert (forward, turn) == pytest.approx((linear, angular), abs=1e-12)
    assert controller.velocity == pytest.approx((linear, angular))


@pytest.mark.parametrize('sign', [1.0, -1.0])
@pytest.mark.parametrize('dt', [0.001, 0.005, 0.02])
def test_speed_grows_with_the_acceleration_limit_at_any_rate(controller, sign, dt):
    controller.command(sign * 0.8, sign * 3.0)
    run(controller, 0.4, dt)
    assert controller.velocity.linear == pytest.approx(sign * 0.5 * 0.4)
    assert controller.velocity.angular == pytest.approx(sign * 2.0 * 0.4)


def test_speed_goes_to_the_target_and_not_beyond(controller):
    controller.command(0.1, -0.2)
    velocities = run(controller, 0.45)
    assert max(velocity.linear for velocity in velocities) == pytest.approx(0.1)
    assert velocities[-1] == pytest.approx((0.1, -0.2))


def test_speed_changes_by_no_more_than_the_limit_even_through_zero(controller):
    controller.command(0.2, 0.0)
    run(controller, 0.45)
    controller.command(-0.2, 0.0)
    speeds = [velocity.linear for velocity in run(controller, 0.45)]
    steps = [abs(b - a) for a, b in zip(speeds, speeds[1:], strict=False)]
    assert max(steps) <= 0.5 * DT + 1e-12
    assert speeds[0] == pytest.approx(0.2 - 0.5 * DT)


@pytest.mark.parametrize(
    ('command', 'target'),
    [
        ((8.0, 0.0), (0.8, 0.0)),
        ((0.0, -9.0), (0.0, -3.0)),
        ((1.6, 2.0), (0.8, 1.0)),
        ((-0.4, 6.0), (-0.2, 3.0)),
        ((-8.0, -6.0), (-0.8, -0.6)),
        ((1.0, 3.0), (0.8, 2.4)),
        ((0.7, -2.9), (0.7, -2.9)),
    ],
)
def test_a_command_beyond_a_limit_keeps_its_curve(controller, command, target):
    assert controller.command(*command)
    assert controller.target == pytest.approx(target, abs=1e-12)


def test_wheels_are_not_asked_for_more_than_they_can(geometry):
    # 0.8 m/s and 2 rad/s make 13.33 + 6.33 rad/s at the outer wheel; half of that is 9.83.
    wheels = replace(geometry, speed_limit=(0.8 + 2.0 * 0.19) / 0.06 / 2.0)
    controller = DiffDriveController(wheels, LIMITS)
    controller.command(0.8, 2.0)
    assert controller.target == pytest.approx((0.4, 1.0))


@pytest.mark.slow
def test_on_the_way_from_straight_to_a_turn_no_wheel_is_too_fast(geometry):
    wheels = replace(geometry, speed_limit=10.0)
    limits = replace(LIMITS, linear_max_acceleration=0.2, angular_max_acceleration=20.0)
    controller = DiffDriveController(wheels, limits)
    fastest = 0.0
    for command in ((0.6, 0.0), (0.0, 3.0)):
        for _ in range(800):
            controller.command(*command)
            fastest = max(fastest, *map(abs, controller.step(0.0, 0.0, DT)))
    assert fastest == pytest.approx(10.0)
    assert controller.velocity == pytest.approx((0.0, 3.0))


@pytest.mark.parametrize('command', [(1e308, 1e308), (-1e308, 1e-300), (5e-324, 1e308)])
def test_an_absurd_command_is_a_finite_one(geometry, command):
    controller = DiffDriveController(replace(geometry, speed_limit=25.0), LIMITS)
    controller.command(*command)
    assert all(math.isfinite(value) for value in controller.target)


def test_a_new_limit_acts_on_the_command_in_force(controller):
    controller.command(0.6, 1.2)
    controller.parameters = replace(LIMITS, linear_max_velocity=0.3)
    assert controller.target == pytest.approx((0.3, 0.6))
    controller.parameters = LIMITS
    assert controller.target == pytest.approx((0.6, 1.2))


def test_wheels_that_slow_down_to_new_limits_are_still_believed(geometry):
    controller = DiffDriveController(geometry, replace(LIMITS, linear_max_velocity=1.0))
    left = right = 0.0
    for index in range(1200):
        if index == 600:
            controller.parameters = replace(
                LIMITS, linear_max_velocity=0.1, angular_max_velocity=0.3
            )
        controller.command(1.0, 0.0)
        speeds = controller.step(left, right, DT)
        left, right = left + speeds[0] * DT, right + speeds[1] * DT
    assert controller.velocity.linear == pytest.approx(0.1)
    assert controller.restarts == 0
    assert controller.odometry_state.x == pytest.approx(0.06 * left, abs=0.01)
    # Later on these are no wheels that can be: 2.6 rad/s are commanded at most.
    controller.step(left + 20.0 * DT, right, DT)
    assert controller.restarts == 1


def test_a_reset_in_another_process_gives_no_spike(controller, geometry):
    controller.command(0.5, 0.0)
    left, right = geometry.wheel_speeds(0.5, 0.0)
    for index in range(500):
        controller.step(left * 0.02 * index, right * 0.02 * index, 0.02)
    before = controller.odometry_state
    assert before.linear == pytest.approx(0.5)
    controller.step(0.0, 0.0, 0.02)
    after = controller.odometry_state
    assert (after.x, after.y, after.yaw) == (before.x, before.y, before.yaw)
    assert abs(after.linear) <= 1.0


def test_a_gap_between_states_is_driven_in_full_but_without_a_jump(controller, geometry):
    # Three seconds without a message: the wheels went on, and the speed is theirs.
    left, right = geometry.wheel_speeds(0.5, 0.0)
    controller.command(0.8, 0.0)
    controller.step(0.0, 0.0, DT)
    controller.command(0.8, 0.0)
    controller.step(3.0 * left, 3.0 * right, 3.0)
    assert controller.odometry_state.x == pytest.approx(1.5)
    assert controller.odometry_state.linear == pytest.approx(0.5)
    assert controller.velocity.linear == pytest.approx(0.5 * (DT + 0.1))


def test_after_the_time_out_it_brakes_with_the_limit_and_stops(controller):
    controller.command(0.2, 0.0)
    velocities = run(controller, 0.5)
    assert velocities[-1].linear == pytest.approx(0.2)
    velocities = run(controller, 0.2 / 0.5 + 2 * DT)  # the ramp, and a cycle at each end
    assert velocities[-1] == Velocity(0.0, 0.0)
    slope = (velocities[11].linear - velocities[1].linear) / (10 * DT)
    assert slope == pytest.approx(-0.5)


def test_the_state_tells_driving_from_timed_out_and_stopped(controller):
    states = []
    controller.command(0.2, 0.0)
    for _ in range(round(1.0 / DT)):
        controller.step(0.0, 0.0, DT)
        if not states or states[-1] != controller.state:
            states.append(controller.state)
    assert states == ['driving', 'timed out', 'stopped']


def test_commands_in_time_keep_it_going(controller):
    for _ in range(10):
        controller.command(0.2, 0.0)
        velocities = run(controller, 0.45)
    assert velocities[-1].linear == pytest.approx(0.2)


def test_a_time_out_of_zero_is_none(geometry):
    controller = DiffDriveController(geometry, DiffDriveParameters(cmd_vel_timeout=0.0))
    controller.command(0.2, 0.0)
    assert run(controller, 60.0, dt=0.1)[-1].linear == pytest.approx(0.2)


@pytest.mark.parametrize('bad', [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize('axis', [0, 1])
def test_a_command_that_is_not_finite_is_refused_and_the_last_one_stays(controller, bad, axis):
    controller.command(0.2, 0.1)
    assert not controller.command(*((bad, 0.0) if axis == 0 else (0.0, bad)))
    assert controller.refused_commands == 1
    assert controller.target == (0.2, 0.1)


def test_refused_commands_do_not_keep_it_going(controller):
    controller.command(0.2, 0.0)
    for _ in range(round(1.2 / DT)):
        controller.command(math.nan, 0.0)
        controller.step(0.0, 0.0, DT)
    assert controller.velocity == Velocity()


def test_a_step_of_no_time_changes_nothing(controller):
    controller.command(0.2, 0.0)
    assert controller.step(0.0, 0.0, 0.0) == (0.0, 0.0)


def test_a_reset_forgets_command_speed_and_place(controller):
    controller.command(0.2, 0.1)
    for index in range(50):
        controller.step(0.1 * index, 0.1 * index, DT)
    assert controller.odometry_state.x > 0.1
    controller.reset()
    assert (controller.target, controller.velocity) == (Velocity(), Velocity())
    assert controller.odometry_state == OdometryState()
    assert controller.step(99.0, 99.0, DT) == (0.0, 0.0)
    assert controller.odometry_state == OdometryState()


def test_without_limits_odometry_still_believes_the_wheels(geometry):
    nan = math.nan
    controller = DiffDriveController(
        replace(geometry, speed_limit=25.0),
        DiffDriveParameters(linear_max_velocity=nan, angular_max_velocity=nan),
    )
    controller.step(0.0, 0.0, DT)
    for index in range(1, 101):  # 0.1 rad each 5 ms: 1.2 m/s
        controller.step(0.1 * index, 0.1 * index, DT)
    assert controller.odometry_state.x == pytest.approx(100 * 0.1 * 0.06)
    assert controller.odometry.restarts == 0


def test_reverse_and_braking_have_limits_of_their_own(geometry):
    parameters = replace(
        LIMITS, linear_max_deceleration=-2.0, linear_min_velocity=-0.1, cmd_vel_timeout=9.0
    )
    controller = DiffDriveController(geometry, parameters)
    controller.command(0.4, 0.0)
    run(controller, 1.0)
    controller.command(-0.5, 0.0)
    speeds = [velocity.linear for velocity in run(controller, 1.0)]
    assert speeds[0] == pytest.approx(0.4 - 2.0 * DT)
    assert speeds[-1] == -0.1


def test_a_limit_of_jerk_makes_the_stop_after_the_time_out_smooth_too(geometry):
    parameters = replace(LIMITS, linear_max_jerk=2.0)
    controller = DiffDriveController(geometry, parameters)
    for _ in range(10):
        controller.command(0.4, 0.0)
        run(controller, 0.1)
    speeds = [velocity.linear for velocity in run(controller, 2.0)]
    slopes = [(b - a) / DT for a, b in zip(speeds, speeds[1:], strict=False)]
    jerks = [(b - a) / DT for a, b in zip(slopes, slopes[1:], strict=False)]
    assert speeds[-1] == 0.0
    assert max(map(abs, jerks)) <= 2.0 + 1e-6
    assert min(slopes) == pytest.approx(-0.5)


def test_an_accel_limit_keeps_the_limits_of_jerk(geometry):
    parameters = replace(
        LIMITS, accel_limit=1.0, linear_max_jerk=2.0, angular_max_jerk=3.0, angular_min_jerk=-4.0
    )
    controller = DiffDriveController(geometry, parameters)
    controller.command(0.5, 1.0)
    velocities = np.array([(0.0, 0.0), *run(controller, 0.4)])
    jerks = np.diff(velocities, 2, axis=0, prepend=[(0.0, 0.0)]) / DT**2
    assert jerks[:, 0].max() == pytest.approx(2.0)
    assert jerks[:, 1].max() == pytest.approx(3.0)
    assert parameters.linear_limits().slow_down == 1.0
    assert parameters.angular_limits(0.4).fall == 4.0


def test_a_change_of_limits_on_a_ramp_keeps_speed_and_acceleration(geometry):
    parameters = replace(LIMITS, linear_max_jerk=2.0)
    controller = DiffDriveController(geometry, parameters)
    controller.command(0.8, 0.0)
    before = [velocity.linear for velocity in run(controller, 0.2)][-2:]
    controller.parameters = replace(parameters, angular_max_velocity=1.0)
    after = run(controller, DT)[0].linear
    slopes = (before[1] - before[0]) / DT, (after - before[1]) / DT
    assert slopes[1] - slopes[0] <= 2.0 * DT + 1e-9
    assert slopes[1] >= slopes[0]


def test_open_loop_counts_what_is_commanded(geometry):
    controller = DiffDriveController(geometry, replace(LIMITS, open_loop=True))
    controller.command(0.2, 0.0)
    run(controller, 0.4)  # the wheels stand
    path = 0.5 * 0.4**2 / 2.0
    assert controller.odometry_state.x == pytest.approx(path, abs=0.2 * DT)
    assert controller.odometry_state.linear > 0.1


@pytest.mark.parametrize('window', [1, 10])
def test_the_velocity_is_the_mean_over_the_window(geometry, window):
    parameters = replace(LIMITS, velocity_rolling_window_size=window)
    controller = DiffDriveController(geometry, parameters)
    speeds = [0.1 if index % 2 else 0.3 for index in range(40)]  # a wheel that judders
    angle = 0.0
    for speed in speeds:
        controller.step(angle, angle, DT)
        angle += speed * DT / 0.06
    # The last step looked at is the one before the last.
    expected = sum(speeds[-1 - window : -1]) / window
    assert controller.odometry_state.linear == pytest.approx(expected)
