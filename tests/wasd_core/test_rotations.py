# SPDX-License-Identifier: Apache-2.0
from cases import for_all
import mujoco
import numpy as np
import pinocchio
import pytest
from wasd_core.rotations import (
    cross,
    matrix_from_quaternion,
    rotate_inverse,
    rotation_vector,
    rpy_from_matrix,
    rpy_matrix,
    to_quaternion,
)


@pytest.fixture
def rng() -> np.random.Generator:
    """Return random numbers that are the same each time."""
    return np.random.default_rng(7)


def test_rpy_round_trip_and_quaternion_agree(rng):
    for _ in range(20):
        rpy = rng.uniform((-3.0, -1.5, -3.0), (3.0, 1.5, 3.0))
        R = rpy_matrix(*rpy)
        np.testing.assert_allclose(rpy_from_matrix(R), rpy, atol=1e-9)
        np.testing.assert_allclose(
            matrix_from_quaternion(np.array(to_quaternion(R))), R, atol=1e-12
        )


def test_rotation_vector_is_that_of_pinocchio(rng):
    for _ in range(20):
        vector = rng.uniform(-1.5, 1.5, 3)
        np.testing.assert_allclose(rotation_vector(pinocchio.exp3(vector)), vector, atol=1e-9)
    np.testing.assert_array_equal(rotation_vector(np.eye(3)), 0.0)


def test_cross_is_the_cross_product(rng):
    a, b = rng.normal(size=(2, 3))
    np.testing.assert_allclose(cross(a, b), np.cross(a, b))


@for_all('seed', range(5))
def test_a_world_vector_is_seen_from_a_turned_frame_as_its_matrix_says(seed):
    random = np.random.default_rng(seed)
    quaternion = random.normal(size=4)
    quaternion /= np.linalg.norm(quaternion)
    v_world = random.normal(size=3)
    R_world_base = np.empty(9)
    mujoco.mju_quat2Mat(R_world_base, quaternion)
    v_base = R_world_base.reshape(3, 3).T @ v_world
    np.testing.assert_allclose(rotate_inverse(quaternion, v_world), v_base, atol=1e-15, rtol=1e-13)
