# SPDX-License-Identifier: Apache-2.0
"""The heading by an IMU that drifts: held while the feet stand, and the drift's rate is found."""

import math

from cases import for_all
import numpy as np
import pytest
from quadruped_sim.estimation.heading import Heading
from quadruped_sim.robot_state import RobotState, turn_base
from quadruped_sim.tuning import EstimatorParameters
from wasd_core.rotations import yaw_matrix

DT = 0.002
FEET = np.array(
    [(0.19, 0.14, -0.3), (0.19, -0.14, -0.3), (-0.19, 0.14, -0.3), (-0.19, -0.14, -0.3)]
)
STANDS, WALKS = np.ones(4), np.array((1.0, 0.0, 0.0, 1.0))
DRIFT = 4e-4  # [rad/s]


def rest(heading, seconds, start=0.0):
    """Stand still while the IMU's heading drifts; the drift in the end."""
    drift = start
    for _ in range(round(seconds / DT)):
        drift += DT * DRIFT
        heading.step(yaw_matrix(drift), FEET, STANDS, DT)
    return drift


@pytest.mark.slow
def test_at_rest_the_heading_is_held_and_the_bias_found():
    heading = Heading(EstimatorParameters())
    drift = rest(heading, 20.0)
    assert drift == pytest.approx(math.radians(0.458), rel=1e-3)
    assert heading.offset == pytest.approx(drift, abs=3e-4)
    assert heading.bias == pytest.approx(DRIFT, rel=0.3)


def test_on_the_way_the_drift_that_was_found_is_taken_off():
    heading = Heading(EstimatorParameters())
    heading.flat['bias'] = DRIFT
    drift = 0.0
    for _ in range(1000):
        drift += DT * DRIFT
        heading.step(yaw_matrix(drift), FEET, WALKS, DT)
    assert heading.offset == pytest.approx(drift, rel=1e-9)
    quaternion = np.array((math.cos(0.5 * drift), 0.0, 0.0, math.sin(0.5 * drift)))
    robot = RobotState.blank()
    turn_base(robot.flat, quaternion, np.zeros(3), heading.drift)
    np.testing.assert_allclose(robot.base.R, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(robot.base.omega, (0.0, 0.0, -DRIFT))


def test_a_robot_that_turns_over_its_feet_has_not_drifted():
    """It turns by 0.03 rad: so little that the feet still count as where they were."""
    heading = Heading(EstimatorParameters())
    rest(heading, 0.4)
    before = heading.offset
    for tick in range(500):
        turn = yaw_matrix(0.03 * tick / 500)
        heading.step(turn, FEET @ turn, STANDS, DT)
    assert heading.offset == pytest.approx(before, abs=5e-4)


@for_all('seconds', [0.0, 1.0])
@for_all('rate', [0.1, 0.8, 3.0])
def test_a_robot_turned_with_its_feet_as_they_are_has_not_drifted(rate, seconds):
    """It is twisted on ice, or carried: no gyro drifts so fast."""
    heading = Heading(EstimatorParameters())
    start = rest(heading, seconds)
    for tick in range(1000):
        heading.step(yaw_matrix(start + rate * DT * tick), FEET, STANDS, DT)
    assert abs(heading.offset) < 0.02
    assert abs(heading.bias) < 2e-3


def test_feet_that_move_begin_anew_and_are_not_taken_for_drift():
    """Feet that slide by 5 cm as if the robot turned by 0.25 rad: nothing of it is believed."""
    heading = Heading(EstimatorParameters())
    for tick in range(500):
        heading.step(np.eye(3), FEET @ yaw_matrix(0.25 * tick / 500), STANDS, DT)
    assert abs(heading.offset) < 0.002
    assert abs(heading.bias) < 2e-4


def test_how_far_the_heading_may_be_off_grows_on_the_way_and_not_at_rest():
    """An unknown bias of deviation s turns it by s t: 2e-4 rad/s in 100 s are 0.02 rad."""
    params = EstimatorParameters(gyro_noise=1e-9, gyro_walk=0.0)
    heading = Heading(params)
    for _ in range(500):
        heading.step(np.eye(3), FEET, WALKS, 0.2)
    assert math.sqrt(heading.variance) == pytest.approx(100.0 * params.gyro_bias, rel=0.01)
    before = heading.variance
    rest(heading, 1.0)
    assert heading.variance == before
