# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
import math
from typing import NamedTuple

import numpy as np
import pytest
from quadruped_sim.estimation.ground import Ground
from quadruped_sim.estimation.kalman import _anchor, Footing, KalmanEstimator
from quadruped_sim.leg_kinematics import foot_positions, leg_motion
from quadruped_sim.robot_state import RobotState
from quadruped_sim.tuning import EstimatorParameters
from wasd_core.robot_io import ImuReading
from wasd_core.rotations import yaw_matrix

DT = 0.002
UP = np.array((0.0, 0.0, 1.0))
PLANE = Ground().flat
ANGLES = np.tile((0.0, 0.8, -1.6), 4)


def make(model, yaw=0.0, **parameters):
    parameters = EstimatorParameters(**parameters)
    estimator = KalmanEstimator(parameters, model.geometry.foot_radius, np.zeros(3))
    feet = foot_positions(model.geometry, ANGLES) @ yaw_matrix(yaw).T
    position = np.array((0.0, 0.0, model.geometry.foot_radius - feet[:, 2].min()))
    estimator.reset(position, position + feet)
    return estimator


def feet_of(estimator):
    """Return where the foot centres then are (4, 3) [m]."""
    return estimator._estimate.x[2:6]


class Seen(NamedTuple):
    """What the IMU of a level robot says; its heading is `yaw` [rad]."""

    yaw: float
    omega: np.ndarray
    acceleration: np.ndarray


STILL = Seen(0.0, np.zeros(3), np.array((0.0, 0.0, 9.81)))


def follow(estimator, seen, motion, trust, ticks=1):
    """Take equal readings of IMU and legs on level ground, of a robot that does not step."""
    turned = np.array((math.cos(0.5 * seen.yaw), 0.0, 0.0, math.sin(0.5 * seen.yaw)))
    imu = ImuReading(turned, seen.omega, seen.acceleration)
    robot = replace(RobotState.blank(), motion=motion)
    footing = Footing(trust, UP, PLANE, False, True, 0.0)
    for _ in range(ticks):
        estimator.step(robot.flat, imu, (0.0, 0.0), footing, DT)
    np.testing.assert_allclose(robot.base.position, estimator.position)
    np.testing.assert_allclose(robot.base.velocity, estimator.velocity)


@pytest.fixture
def rolling_rates(model, contact_points):
    """Return joint rates at which the base moves at a velocity, base axes, over rolling feet."""

    def rolling_rates(angles, velocity):
        motion = leg_motion(model.geometry, angles, np.zeros(12))
        J = contact_points(motion, UP, model.geometry.foot_radius).jacobian
        return np.linalg.solve(J, np.tile(-velocity, (4, 1))[:, :, None]).ravel()

    return rolling_rates


@pytest.mark.slow
def test_at_rest_a_biased_accelerometer_does_not_carry_it_away(model):
    estimator = make(model)
    motion = leg_motion(model.geometry, ANGLES, np.zeros(12))
    imu = Seen(0.0, np.zeros(3), np.array((0.05, -0.05, 9.86)))
    follow(estimator, imu, motion, np.ones(4), ticks=5000)
    assert np.linalg.norm(estimator.velocity) < 0.01
    assert np.linalg.norm(estimator.position[:2]) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize('yaw', [0.0, 1.2])
def test_rolling_feet_are_not_read_as_slow(model, rolling_rates, yaw):
    """Base at 0.5 m/s over rolling feet: the estimate is right to 1 %, without it 5 % are lost."""
    estimator = make(model, yaw)
    velocity = np.array((0.5, 0.1, 0.0))
    R = yaw_matrix(yaw)
    imu = Seen(yaw, np.zeros(3), np.array((0.0, 0.0, 9.81)))
    angles = ANGLES - 0.1 * rolling_rates(ANGLES, velocity)
    for _ in range(100):
        rates = rolling_rates(angles, velocity)
        follow(estimator, imu, leg_motion(model.geometry, angles, rates), np.ones(4))
        angles = angles + DT * rates
    np.testing.assert_allclose(estimator.velocity, R @ velocity, atol=0.005)


def test_free_feet_leave_the_velocity_to_the_accelerometer(model):
    estimator = make(model)
    motion = leg_motion(model.geometry, ANGLES, np.zeros(12))
    imu = Seen(0.0, np.zeros(3), np.array((1.0, 0.0, 9.81)))
    follow(estimator, imu, motion, np.zeros(4), ticks=100)
    np.testing.assert_allclose(estimator.velocity, (0.2, 0.0, 0.0), atol=0.01)


@pytest.mark.slow
def test_velocity_converges_within_its_own_bounds(model, rng):
    """After noise on all inputs the error is within four of the filter's standard deviations."""
    estimator = make(model)
    for _ in range(1000):
        motion = leg_motion(
            model.geometry, ANGLES + 1e-3 * rng.normal(size=12), 0.05 * rng.normal(size=12)
        )
        imu = Seen(0.0, 0.01 * rng.normal(size=3), (0, 0, 9.81) + 0.1 * rng.normal(size=3))
        follow(estimator, imu, motion, np.ones(4))
    assert np.abs(estimator.velocity).max() < 4.0 * np.sqrt(estimator.variances[1])
    assert np.abs(estimator.velocity).max() < 0.02


@pytest.mark.slow
def test_height_error_is_drawn_back_near_the_level_of_the_ground_only(model):
    motion = leg_motion(model.geometry, ANGLES, np.zeros(12))
    imu = Seen(0.0, np.zeros(3), np.array((0.0, 0.0, 9.81)))
    remaining = []
    for error in (0.01, 0.2):
        estimator = make(model)
        start = estimator.position.copy()
        lifted = start + (0.0, 0.0, error)
        estimator.reset(lifted, lifted + motion.position)
        follow(estimator, imu, motion, np.ones(4), ticks=5000)
        remaining.append(estimator.position[2] - start[2])
    assert abs(remaining[0]) < 1e-3
    assert abs(remaining[1] - 0.2) < 5e-3


NEVER = 1e12  # a time constant of what is not looked at [s]


def walked(
    model, heights, speed=0.0, aside=0.0, gradient=0.0, rough=0.0, is_broken=False, **parameters
):
    """
    Return an estimator after 40 ms of walking, four feet down.

    `heights` are those over the start of the robot at first, and of the ground that it takes to be
    under it [m]; `aside` is how far its feet are from it [m].
    """
    estimator, ground = make(model, **parameters), Ground()
    height, plane = heights
    estimator.reset(
        estimator.position + (aside, 0.0, height), feet_of(estimator) + (0.0, 0.0, height)
    )
    ground.reset(feet_of(estimator) * (1.0, 1.0, 0.0) + (0.0, 0.0, plane))
    ground._plane.gradient[0] = gradient
    ground._plane.centre[0] = 0.0
    ground._plane.points[:, 2] += gradient * ground._plane.points[:, 0]
    estimator._estimate.x[1, 0], estimator._estimate.level[0] = speed, plane
    footing = Footing(np.ones(4), UP, ground.flat, True, False, rough, is_broken)
    anchor(estimator, footing, 20)
    return estimator


def anchor(estimator, footing, ticks, *, is_thrown=False):
    for _ in range(ticks):
        _anchor(estimator._estimate, footing, estimator._sensors[0], DT, is_thrown)


def drawn(model, *ground, **more):
    """Return how high over the start the feet then are [m]."""
    return feet_of(walked(model, *ground, **more))[:, 2].mean() - model.geometry.foot_radius


@pytest.mark.parametrize(
    ('speed', 'aside', 'share'),
    [(2.0, 0.0, 1.0), (3.0, 0.0, 1.0), (1.0, 0.0, 0.25), (2.0, 0.06, 0.5), (2.0, 0.13, 0.0)],
)
def test_at_speed_feet_are_drawn_to_the_plane_of_the_steps_before(model, speed, aside, share):
    """By exp(-t / step_time), upstairs as well; the less the slower, and the more aside."""
    left = drawn(model, (1.02, 1.0), speed, aside, level_time=NEVER) - 1.0
    assert left == pytest.approx(0.02 * (1.0 - share * DT / 0.04) ** 20, abs=1e-6)


def test_feet_far_off_the_plane_of_the_steps_before_are_on_other_ground(model):
    assert drawn(model, (1.04, 1.0), 2.0, level_time=NEVER) == pytest.approx(1.04, abs=1e-12)


LEVEL_TIME = EstimatorParameters().level_time


@pytest.mark.parametrize('off', [0.01, 0.2])
@pytest.mark.parametrize('level', [0.0, 1.0])
@pytest.mark.parametrize('gradient', [0.0, 0.01, 0.1])
def test_who_walks_on_smooth_ground_drifts_off_its_level_nowhere(model, level, gradient, off):
    """However far: nobody walks onto a table."""
    left = drawn(model, (level + off, level), gradient=gradient) - level
    assert left == pytest.approx(off * (1.0 - DT / LEVEL_TIME) ** 20, abs=2e-4)


@pytest.mark.parametrize(('speed', 'rises'), [(0.0, 0.0), (0.5, 0.015 * 0.5 * 20 * DT)])
def test_on_rough_ground_the_level_creeps_toward_the_feet(model, speed, rises):
    """By 1.5 % of the way; the feet come to it a sixtieth as fast as where it is smooth."""
    estimator = walked(model, (1.02, 1.0), speed, rough=1.0, step_time=NEVER)
    assert estimator.level == pytest.approx(1.0 + rises, abs=1e-9)
    left = feet_of(estimator)[:, 2].mean() - model.geometry.foot_radius - 1.0
    assert left == pytest.approx(0.02 * (1.0 - DT / LEVEL_TIME / 61.0) ** 20, abs=1e-5)


def test_a_floor_that_feels_half_as_rough_as_boxes_draws_feet_as_a_floor_does(model):
    """It is a turn on the spot that rocks the robot: left alone it would leave the floor."""
    estimator = walked(model, (1.02, 1.0), rough=0.35, step_time=NEVER)
    left = feet_of(estimator)[:, 2].mean() - model.geometry.foot_radius - 1.0
    slower = 1.0 + 60.0 * 0.5**6
    assert left == pytest.approx(0.02 * (1.0 - DT / LEVEL_TIME / slower) ** 20, abs=1e-5)
    assert slower < 2.0


@pytest.mark.parametrize(('ticks', 'level'), [(240, 0.0), (260, 0.06)])
def test_who_lands_far_off_the_level_is_on_other_ground_after_half_a_second(model, ticks, level):
    estimator = make(model)
    estimator.reset(estimator.position + (0.0, 0.0, 0.06), feet_of(estimator) + (0.0, 0.0, 0.06))
    anchor(estimator, Footing(np.ones(4), UP, PLANE, False, True, 0.0), ticks)
    assert estimator.level == pytest.approx(level, abs=1e-9)
    assert feet_of(estimator)[:, 2].mean() - model.geometry.foot_radius == pytest.approx(0.06)


def test_the_level_after_a_throw_is_that_of_before(model):
    """The slope between feet that come down anyhow is none; it counts again a second later."""
    estimator, ground = walked(model, (1.0, 1.0)), Ground()
    ground.reset(feet_of(estimator))
    ground._plane.gradient[0], estimator._estimate.x[1, 0] = 0.1, 2.0
    ground._plane.points[:, 2] += 0.1 * ground._plane.points[:, 0]
    footing = Footing(np.ones(4), UP, ground.flat, True, False, 1.0)
    for ticks, is_thrown in ((100, True), (490, False)):
        anchor(estimator, footing, ticks, is_thrown=is_thrown)
        assert estimator.level == pytest.approx(1.0, abs=1e-12)
    anchor(estimator, footing, 100)
    assert estimator.level > 1.01


@pytest.mark.parametrize(('acceleration', 'is_thrown'), [(20.0, False), (40.0, True)])
def test_a_blow_that_no_leg_can_give_is_a_throw(model, acceleration, is_thrown):
    """In 0.1 s 20 m/s^2 are a push of 30 N s, which it walks on after; 40 leave it skidding."""
    estimator, motion = make(model), leg_motion(model.geometry, ANGLES, np.zeros(12))
    blow = Seen(0.0, np.zeros(3), np.array((0.6 * acceleration, 0.8 * acceleration, 9.81)))
    follow(estimator, blow, motion, np.zeros(4), ticks=round(0.1 / DT))
    assert (estimator._estimate.calm[0] < 0.0) == is_thrown
    assert (estimator._estimate.shaken[0] > 0.0) == is_thrown
    mean = acceleration * (1.0 - (1.0 - DT / 0.1) ** round(0.1 / DT))
    assert np.hypot(*estimator._estimate.struck) == pytest.approx(mean, rel=0.01)


@pytest.mark.parametrize(('speed', 'is_thrown'), [(3.5, False), (4.5, True)])
def test_a_robot_faster_than_legs_drive_it_is_thrown(model, speed, is_thrown):
    estimator, motion = make(model), leg_motion(model.geometry, ANGLES, np.zeros(12))
    estimator._estimate.x[1, 0] = speed
    follow(estimator, STILL, motion, np.zeros(4))
    assert (estimator._estimate.calm[0] < 0.0) == is_thrown


@pytest.mark.parametrize('since', [0.1, 1.5])
def test_after_a_blow_feet_are_drawn_to_the_level_of_before_as_on_a_floor(model, since):
    """However rough the ground then feels, also when it skids no more."""
    estimator = walked(model, (1.02, 1.0), 2.0, rough=1.0, step_time=NEVER)
    creeping = feet_of(estimator)[:, 2].mean() - model.geometry.foot_radius - 1.0
    estimator._estimate.shaken[0] = 4.0 - since
    estimator._estimate.calm[0] = since - 1.0
    rough = Footing(np.ones(4), UP, PLANE, True, False, 1.0)
    level = estimator.level
    anchor(estimator, rough, 20)
    left = feet_of(estimator)[:, 2].mean() - model.geometry.foot_radius - level
    drawn = (1.0 - DT / LEVEL_TIME) ** 20
    assert left == pytest.approx((1.0 + creeping - level) * drawn, abs=1e-6)


def test_the_level_climbs_with_the_slope(model):
    climbed = walked(model, (1.0, 1.0), 0.5, gradient=0.02)
    assert climbed.level == pytest.approx(1.0 + 0.02 * 0.5 * 20 * DT, abs=1e-9)


@pytest.mark.parametrize('calm', [0.0, 9.0])
def test_over_steps_that_are_seen_feet_carry_the_level(model, calm):
    """Also of a robot that has just pitched fast: on stairs the level was lost by 0.6 m."""
    estimator = walked(model, (1.15, 1.0), 0.5, gradient=0.4, rough=0.5, is_broken=True)
    assert feet_of(estimator)[:, 2].mean() - model.geometry.foot_radius == pytest.approx(1.15)
    middle = feet_of(estimator)[:, 0].mean() - estimator.position[0]
    assert estimator.level == pytest.approx(1.15 - 0.4 * middle)
    estimator._estimate.calm[0] = calm
    smooth = Ground()
    smooth.reset(feet_of(estimator) * (1.0, 1.0, 0.0) + (0.0, 0.0, estimator.level))
    anchor(estimator, Footing(np.ones(4), UP, smooth.flat, True, False, 0.0), 1000)
    feet = feet_of(estimator)[:, 2].mean() - model.geometry.foot_radius
    assert feet == pytest.approx(estimator.level, abs=1e-3)
    assert estimator.level == pytest.approx(1.15 - 0.4 * middle)


def test_a_level_near_that_of_the_start_becomes_it(model):
    levels = [walked(model, (at, at))._estimate.level[0] for at in (0.015, 0.03)]
    assert levels[0] == pytest.approx(0.015 * (1.0 - DT) ** 20, abs=1e-4)
    assert levels[1] == pytest.approx(0.03)


def test_a_foot_that_slips_is_left_out(model, rolling_rates):
    """One leg says 1 m/s, three say rest: all believed, they would make it 0.25 m/s."""
    estimator = make(model)
    slipping = rolling_rates(ANGLES, np.array((1.0, 0.0, 0.0)))
    slipping[3:] = 0.0
    imu = Seen(0.0, np.zeros(3), np.array((0.0, 0.0, 9.81)))
    for _ in range(20):
        motion = leg_motion(model.geometry, ANGLES, slipping)
        follow(estimator, imu, motion, np.ones(4))
    np.testing.assert_allclose(estimator.velocity, 0.0, atol=1e-6)


def slipping(model, feet, velocity):
    """Leg motion of a base at rest of which these feet slip at `velocity` (3,), base axes."""
    motion = leg_motion(model.geometry, ANGLES, np.zeros(12))
    rates = np.zeros((4, 3))
    for foot in feet:
        rates[foot] = np.linalg.solve(motion.jacobian[foot], velocity)
    return leg_motion(model.geometry, ANGLES, rates.ravel())


@pytest.mark.slow
@pytest.mark.parametrize('feet', [(1,), (0, 3), (0, 1, 2, 3)])
def test_feet_that_slip_are_left_out(model, feet):
    """0.2 s at 0.5 m/s: believed, they are the robot's velocity, 0.5 m/s, 0.25 if half of them."""
    estimator = make(model)
    stands, slips = slipping(model, (), np.zeros(3)), slipping(model, feet, (0.5, 0.0, 0.0))
    follow(estimator, STILL, stands, np.ones(4), ticks=250)
    for _ in range(100):
        follow(estimator, STILL, slips, np.ones(4))
        assert estimator._estimate.belief[list(feet)].max() < 0.1
    assert abs(estimator.velocity[0]) < (0.15 if len(feet) == 4 else 0.02)
    assert np.delete(estimator._estimate.belief, feet).min(initial=1.0) > 0.5


@pytest.mark.slow
def test_a_blow_between_two_readings_does_not_stay(model):
    """The accelerometer is told 500 m/s^2 for one reading: 1 m/s that never was."""
    estimator = make(model)
    stands = slipping(model, (), np.zeros(3))
    blow = STILL._replace(acceleration=np.array((500.0, 0.0, 9.81)))
    follow(estimator, blow, stands, np.ones(4))
    follow(estimator, STILL, stands, np.ones(4), ticks=250)
    assert np.abs(estimator.velocity).max() < 0.01


@pytest.mark.slow
def test_the_bias_of_the_accelerometer_is_found_in_ten_seconds_of_rest(model):
    estimator = make(model, yaw=1.0)
    bias = np.array((0.06, -0.03, 0.04))
    imu = Seen(1.0, np.zeros(3), bias + (0.0, 0.0, 9.81))
    stands = slipping(model, (), np.zeros(3))
    follow(estimator, imu, stands, np.ones(4), ticks=5000)
    np.testing.assert_allclose(estimator._estimate.x[6], bias, atol=0.006)


@pytest.mark.slow
def test_turning_about_the_base_moves_the_imu_but_not_the_base(model):
    """An IMU 0.1 m ahead feels the centre, 0.4 m/s^2 away, and is carried round it."""
    params, offset, rate = EstimatorParameters(), np.array((0.1, 0.0, 0.0)), 2.0
    estimator = KalmanEstimator(params, model.geometry.foot_radius, offset)
    feet = foot_positions(model.geometry, ANGLES)
    estimator.reset(np.zeros(3), feet)
    motion = leg_motion(model.geometry, ANGLES, np.zeros(12))
    acceleration = np.array((-rate * rate * offset[0], 0.0, 9.81))
    for tick in range(500):
        imu = Seen(tick * DT * rate, np.array((0.0, 0.0, rate)), acceleration)
        follow(estimator, imu, motion, np.zeros(4))
        if tick == 0:  # the first reading finds it at rest
            estimator._estimate.x[1] = (0.0, rate * offset[0], 0.0)
    np.testing.assert_allclose(estimator.velocity, np.zeros(3), atol=0.002)
    np.testing.assert_allclose(estimator.position, np.zeros(3), atol=0.002)
