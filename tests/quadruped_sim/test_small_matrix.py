# SPDX-License-Identifier: Apache-2.0
import numpy as np
from quadruped_sim.algebra import (
    cross3,
    invert3,
    rotate,
    rotate_back,
    solve_in_place,
    write_rotation,
)
from quadruped_sim.locomotion.feedback import rotation_error
from wasd_core.rotations import matrix_from_quaternion, rotation_vector, rpy_matrix


def inverse(A):
    out = np.empty((3, 3))
    invert3(A, out)
    return out


def test_products_are_those_of_numpy(rng):
    A, v, w = rng.normal(size=(3, 3)), rng.normal(size=3), rng.normal(size=3)
    np.testing.assert_allclose(rotate(A, v), A @ v)
    np.testing.assert_allclose(rotate_back(A, v), A.T @ v)
    np.testing.assert_allclose(cross3(v, w), np.cross(v, w))
    np.testing.assert_allclose(inverse(A), np.linalg.inv(A), rtol=1e-9)


def test_systems_are_solved_as_by_numpy(rng):
    for n in (1, 3, 6):
        L = rng.normal(size=(n, n))
        A, B = L @ L.T + 0.1 * np.eye(n), rng.normal(size=(n, 4))
        wanted = np.linalg.solve(A, B)
        solve_in_place(A.copy(), B)
        np.testing.assert_allclose(B, wanted, rtol=1e-8)


def test_a_singular_matrix_gives_no_finite_inverse():
    assert not np.isfinite(inverse(np.zeros((3, 3)))).all()


def test_rotations_are_those_of_plain_numbers(rng):
    for rpy in rng.uniform(-1.2, 1.2, size=(5, 3)):
        quaternion, R = 2.0 * rng.normal(size=4), np.empty((3, 3))
        write_rotation(quaternion, R)
        np.testing.assert_allclose(R, matrix_from_quaternion(quaternion), atol=1e-12)
        wanted = rotation_vector(rpy_matrix(*rpy) @ R.T)
        np.testing.assert_allclose(rotation_error(rpy, R), wanted, atol=1e-9)
