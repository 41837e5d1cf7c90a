# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from quadruped_sim.robot_model import NO_TORQUE
from quadruped_sim.safety import FallWatch, Safety
from quadruped_sim.tuning import SafetyParameters
from wasd_core.rotations import rpy_matrix

ANGLES = np.tile((0.0, 0.8, -1.6), 4)
DT = 0.002


def make(model):
    return Safety(SafetyParameters(), model.limits)


def test_a_broken_reading_is_replaced_by_the_last_good_one(model, standing):
    safety = make(model)
    good = standing
    bad = good._replace(joints=good.joints._replace(position=np.full(12, np.nan)))
    assert safety.filter_reading(bad) is None
    assert safety.filter_reading(good) is good
    assert safety.filter_reading(bad) is good
    assert safety.reason_to_let_go(np.eye(3), ANGLES, 0) is None
    for _ in range(3):
        safety.filter_reading(bad)
    assert 'not finite' in safety.reason_to_let_go(np.eye(3), ANGLES, 0)


def test_tilt_beyond_sixty_degrees_lets_go(model):
    safety = make(model)
    assert safety.reason_to_let_go(rpy_matrix(np.radians(59), 0, 0), ANGLES, 0) is None
    assert 'tilt 61 deg' in safety.reason_to_let_go(rpy_matrix(0, np.radians(61), 0), ANGLES, 0)


def test_joint_out_of_range_and_failing_solvers_let_go(model):
    safety = make(model)
    assert 'joint' in safety.reason_to_let_go(np.eye(3), ANGLES + 2.0, 0)
    assert 'QPs' in safety.reason_to_let_go(np.eye(3), ANGLES, 100)


def test_efforts_are_limited_and_nan_never_reaches_the_motors(model):
    safety = make(model)
    command = safety.filter_command(NO_TORQUE._replace(effort=np.full(12, 100.0)))
    np.testing.assert_allclose(command.effort, np.tile((23.7, 23.7, 35.55), 4))
    assert safety.filter_command(NO_TORQUE._replace(effort=np.full(12, np.nan))) is None


def test_what_no_motor_pushes_by_cannot_be_written_into():
    # Every command that damps shares these numbers.
    for part in NO_TORQUE:
        with pytest.raises(ValueError, match='read-only'):
            part[:] = 100.0


def test_a_trunk_that_stays_low_has_fallen_and_one_that_crouches_for_a_moment_has_not():
    falls = FallWatch()
    assert falls.step(1.0, False, DT) is None
    assert not any(falls.step(0.3, False, DT) for _ in range(90))
    assert falls.step(0.6, False, DT) is None
    assert 'gone down' in [falls.step(0.3, False, DT) for _ in range(110)][-1]


def test_who_may_be_low_never_falls_and_who_rises_is_given_time():
    falls = FallWatch()
    assert not any(falls.step(0.2, True, DT) for _ in range(5000))
    assert not any(falls.step(0.2, False, DT) for _ in range(2900))
    assert 'cannot get up' in [falls.step(0.2, False, DT) for _ in range(200)][-1]
