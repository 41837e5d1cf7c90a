# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from quadruped_sim.algebra import cross
from quadruped_sim.algebra import matrix_from_quaternion
from quadruped_sim.algebra import matrix_from_rpy
from quadruped_sim.algebra import quaternion_from_rpy
from quadruped_sim.algebra import rotation_vector
from quadruped_sim.algebra import rpy_from_matrix
from quadruped_sim.algebra import skew
from quadruped_sim.algebra import wrap_angle
from scipy.spatial.transform import Rotation


def test_rpy_round_trip_and_quaternion_agree(rng):
    for _ in range(20):
        rpy = rng.uniform((-3.0, -1.5, -3.0), (3.0, 1.5, 3.0))
        R = matrix_from_rpy(*rpy)
        np.testing.assert_allclose(rpy_from_matrix(R), rpy, atol=1e-9)
        np.testing.assert_allclose(
            matrix_from_quaternion(quaternion_from_rpy(*rpy)), R, atol=1e-12
        )


def test_rotation_vector_is_that_of_scipy(rng):
    for _ in range(20):
        vector = rng.uniform(-1.5, 1.5, 3)
        R = Rotation.from_rotvec(vector).as_matrix()
        np.testing.assert_allclose(rotation_vector(R), vector, atol=1e-9)
    np.testing.assert_array_equal(rotation_vector(np.eye(3)), 0.0)


def test_cross_and_skew_are_the_cross_product(rng):
    a, b = rng.normal(size=(2, 3))
    np.testing.assert_allclose(cross(a, b), np.cross(a, b))
    np.testing.assert_allclose(skew(a) @ b, np.cross(a, b))


@pytest.mark.parametrize(
    ('angle', 'wanted'), [(4.0, 4.0 - 2 * np.pi), (np.pi, np.pi), (-np.pi, np.pi)]
)
def test_wrapped_angles_lie_in_one_turn(angle, wanted):
    assert wrap_angle(angle) == pytest.approx(wanted)
