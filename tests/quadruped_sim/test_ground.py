# SPDX-License-Identifier: Apache-2.0
import leg_stages
import numpy as np
from quadruped_sim.estimation.ground import Ground, height_at
from quadruped_sim.tuning import GroundParameters

FEET = np.array(((0.2, 0.15, 0.0), (0.2, -0.15, 0.0), (-0.2, 0.15, 0.0), (-0.2, -0.15, 0.0)))
ALL = np.ones(4, dtype=bool)


def on_slope(gradient):
    feet = FEET.copy()
    feet[:, 2] = feet[:, :2] @ gradient
    return feet


def gradient_of(ground):
    """Slope along x and y by its unit normal."""
    x, y, z = ground.normal()
    return np.array((-x / z, -y / z))


def settle(ground, feet, rules, contact=ALL, seconds=5.0):
    for _ in range(round(seconds / 0.002)):
        leg_stages.stand(ground, feet, contact, rules, 0.002)


def test_it_finds_the_plane_its_feet_stand_on(rules):
    ground = Ground()
    gradient = np.array((0.27, -0.1))
    settle(ground, on_slope(gradient), rules)
    np.testing.assert_allclose(gradient_of(ground), gradient, atol=1e-3)
    height = height_at(ground.flat[0], 1.0, 2.0)
    np.testing.assert_allclose(height, gradient @ (1, 2), atol=0.01)


def test_frame_is_a_rotation_whose_z_is_the_normal(rules):
    ground = Ground()
    settle(ground, on_slope((0.3, 0.2)), rules)
    frame = ground.frame()
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert abs(np.linalg.det(frame) - 1.0) < 1e-12
    np.testing.assert_allclose(frame[:, 2], ground.normal())
    np.testing.assert_allclose(frame[:, 2] @ (1.0, 0.0, 0.3), 0.0, atol=1e-3)


def test_a_foot_in_the_air_does_not_move_it(rules):
    ground = Ground()
    settle(ground, FEET, rules)
    lifted = FEET.copy()
    lifted[0, 2] = 0.1
    settle(ground, lifted, rules, np.array((False, True, True, True)))
    np.testing.assert_allclose(gradient_of(ground), 0.0, atol=1e-9)


def test_slopes_beyond_the_limit_are_not_believed(rules):
    ground = Ground()
    settle(ground, on_slope((2.0, 0.0)), rules)
    assert abs(np.hypot(*gradient_of(ground)) - np.tan(GroundParameters().slope_max)) < 1e-3


def test_its_slope_is_the_angle_of_the_plane(rules):
    ground = Ground()
    assert ground.slope == 0.0
    settle(ground, on_slope((0.3, 0.2)), rules)
    np.testing.assert_allclose(ground.slope, np.arctan(np.hypot(0.3, 0.2)), atol=1e-3)
