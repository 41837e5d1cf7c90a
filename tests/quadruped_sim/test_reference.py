# SPDX-License-Identifier: Apache-2.0
from cases import for_all
import leg_stages
import numpy as np
import pytest
from quadruped_sim.estimation.ground import Ground
from quadruped_sim.locomotion.reference import BaseReference, horizon, Reference

TIMES = 0.025 * np.arange(1, 13)


@for_all('yaw_rate', [0.0, 1.5, -2.0])
def test_horizon_pose_is_the_integral_of_its_rate(yaw_rate):
    reference = BaseReference(
        np.array((1.0, 2.0, 0.3)), np.array((0.0, 0.0, 0.4)), np.array((0.6, -0.2, 0.0)), yaw_rate
    )
    times = np.linspace(0.0, 0.3, 3001)
    pose, rate = horizon(reference, 0.4, np.array((1.0, 2.0, 0.3)), times)
    summed = np.concatenate((np.zeros((1, 6)), np.cumsum(0.5 * (rate[1:] + rate[:-1]), axis=0)))
    np.testing.assert_allclose(pose, summed * (times[1] - times[0]), atol=1e-6)


def test_horizon_is_seen_from_the_yaw_frame():
    reference = BaseReference(
        np.array((1.0, 3.0, 0.3)), np.array((0.0, 0.0, np.pi / 2)), np.array((0.0, 1.0, 0.0)), 0.0
    )
    pose, rate = horizon(reference, np.pi / 2, np.array((1.0, 2.0, 0.3)), TIMES)
    np.testing.assert_allclose(rate[:, 3], 1.0)
    np.testing.assert_allclose(pose[:, 3], 1.0 + TIMES)
    np.testing.assert_allclose(pose[:, [0, 1, 2, 4, 5]], 0.0, atol=1e-12)


FEET = np.array(((0.2, 0.15, 0.0), (0.2, -0.15, 0.0), (-0.2, 0.15, 0.0), (-0.2, -0.15, 0.0)))
LEVEL, UP, DOWN = 0.0, np.deg2rad(25.0), -np.deg2rad(25.0)


def pitch(rules, robot_state, slope, speed, nose):
    """Pitch of the reference [rad] on a slope, nose down positive."""
    reference, ground = Reference(), Ground()
    reference.reset(robot_state)
    feet = FEET + np.outer(FEET[:, 0], (0.0, 0.0, np.tan(slope)))
    for _ in range(2500):
        leg_stages.stand(ground, feet, np.ones(4, dtype=bool), rules, 0.002)
    command = np.array((speed, 0.0, 0.0))
    pose = 0.3, nose
    wanted = leg_stages.follow(reference, robot_state, command, ground, pose, rules, 0.002)
    return wanted.rpy[1]


@for_all('speed', [-0.5, 0.0, 0.5])
@for_all('slope', [LEVEL, UP, DOWN])
def test_the_base_is_parallel_to_the_ground(rules, robot_state, slope, speed):
    assert pitch(rules, robot_state, slope, speed, 0.0) == pytest.approx(-slope, abs=1e-6)


@pytest.mark.parametrize(
    ('slope', 'speed', 'up'),
    [
        (LEVEL, 0.5, 0.1),
        (LEVEL, 0.0, 0.0),
        (LEVEL, -0.5, 0.0),
        (UP, 0.5, 0.0),
        (DOWN, 0.5, 0.0),
    ],
)
def test_the_nose_is_up_for_who_goes_ahead_on_the_level(rules, robot_state, slope, speed, up):
    """On a slope as steep as stairs the robot would tip over backward."""
    assert pitch(rules, robot_state, slope, speed, 0.1) == pytest.approx(-slope - up, abs=1e-6)
