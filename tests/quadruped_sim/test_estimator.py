# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from quadruped_sim.estimation.kalman import ImuSample
from quadruped_sim.estimation.kalman import KalmanEstimator
from quadruped_sim.leg_kinematics import foot_positions
from quadruped_sim.leg_kinematics import leg_motion
from quadruped_sim.parameters import EstimatorParameters
from wasd_core.rotations import yaw_matrix

DT = 0.002
UP = np.array((0.0, 0.0, 1.0))
ANGLES = np.tile((0.0, 0.8, -1.6), 4)


def make(model, yaw=0.0):
    estimator = KalmanEstimator(EstimatorParameters(), model.geometry.foot_radius, np.zeros(3))
    feet = foot_positions(model.geometry, ANGLES) @ yaw_matrix(yaw).T
    position = np.array((0.0, 0.0, model.geometry.foot_radius - feet[:, 2].min()))
    estimator.reset(position, position + feet)
    return estimator


def rolling_rates(model, angles, velocity):
    """Joint rates at which the base moves at `velocity`, base axes, over rolling feet."""
    from quadruped_sim.leg_kinematics import contact_points

    motion = leg_motion(model.geometry, angles, np.zeros(12))
    J = contact_points(motion, UP, model.geometry.foot_radius).jacobian
    return np.linalg.solve(J, np.tile(-velocity, (4, 1))[:, :, None]).ravel()


@pytest.mark.slow
def test_at_rest_a_biased_accelerometer_does_not_carry_it_away(model):
    estimator = make(model)
    motion = leg_motion(model.geometry, ANGLES, np.zeros(12))
    imu = ImuSample(np.eye(3), np.zeros(3), np.array((0.05, -0.05, 9.86)))
    for _ in range(5000):
        estimator.step(imu, motion, np.ones(4), UP, DT)
    assert np.linalg.norm(estimator.velocity) < 0.01
    assert np.linalg.norm(estimator.position[:2]) < 0.05


@pytest.mark.parametrize('yaw', [0.0, 1.2])
def test_rolling_feet_are_not_read_as_slow(model, yaw):
    """Base at 0.5 m/s over rolling feet: the estimate is right to 1 %, without it 5 % are lost."""
    estimator = make(model, yaw)
    velocity = np.array((0.5, 0.1, 0.0))
    R = yaw_matrix(yaw)
    imu = ImuSample(R, np.zeros(3), np.array((0.0, 0.0, 9.81)))
    angles = ANGLES - 0.1 * rolling_rates(model, ANGLES, velocity)
    for _ in range(100):
        rates = rolling_rates(model, angles, velocity)
        estimator.step(imu, leg_motion(model.geometry, angles, rates), np.ones(4), UP, DT)
        angles = angles + DT * rates
    np.testing.assert_allclose(estimator.velocity, R @ velocity, atol=0.005)


def test_free_feet_leave_the_velocity_to_the_accelerometer(model):
    estimator = make(model)
    motion = leg_motion(model.geometry, ANGLES, np.zeros(12))
    imu = ImuSample(np.eye(3), np.zeros(3), np.array((1.0, 0.0, 9.81)))
    for _ in range(100):
        estimator.step(imu, motion, np.zeros(4), UP, DT)
    np.testing.assert_allclose(estimator.velocity, (0.2, 0.0, 0.0), atol=0.01)


@pytest.mark.slow
def test_velocity_converges_within_its_own_bounds(model, rng):
    """After noise on all inputs the error is within four of the filter's standard deviations."""
    estimator = make(model)
    for _ in range(1000):
        motion = leg_motion(
            model.geometry, ANGLES + 1e-3 * rng.normal(size=12), 0.05 * rng.normal(size=12)
        )
        imu = ImuSample(
            np.eye(3), 0.01 * rng.normal(size=3), (0, 0, 9.81) + 0.1 * rng.normal(size=3)
        )
        estimator.step(imu, motion, np.ones(4), UP, DT)
    assert np.abs(estimator.velocity).max() < 4.0 * np.sqrt(estimator.variances[1])
    assert np.abs(estimator.velocity).max() < 0.02


@pytest.mark.slow
def test_height_error_is_drawn_back_near_the_start_level_only(model):
    motion = leg_motion(model.geometry, ANGLES, np.zeros(12))
    imu = ImuSample(np.eye(3), np.zeros(3), np.array((0.0, 0.0, 9.81)))
    remaining = []
    for error in (0.01, 0.2):
        estimator = make(model)
        start = estimator.position.copy()
        lifted = start + (0.0, 0.0, error)
        estimator.reset(lifted, lifted + motion.position)
        for _ in range(5000):
            estimator.step(imu, motion, np.ones(4), UP, DT)
        remaining.append(estimator.position[2] - start[2])
    assert abs(remaining[0]) < 1e-3
    assert abs(remaining[1] - 0.2) < 5e-3


def test_a_foot_that_slips_is_left_out(model):
    """One leg says 1 m/s, three say rest: all believed, they would make it 0.25 m/s."""
    estimator = make(model)
    slipping = rolling_rates(model, ANGLES, np.array((1.0, 0.0, 0.0)))
    slipping[3:] = 0.0
    imu = ImuSample(np.eye(3), np.zeros(3), np.array((0.0, 0.0, 9.81)))
    for _ in range(20):
        motion = leg_motion(model.geometry, ANGLES, slipping)
        estimator.step(imu, motion, np.ones(4), UP, DT)
    np.testing.assert_allclose(estimator.velocity, 0.0, atol=1e-6)
