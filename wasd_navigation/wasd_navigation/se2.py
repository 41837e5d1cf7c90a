# SPDX-License-Identifier: Apache-2.0
"""
Poses in the plane: arrays (x, y, yaw) [m], [m], [rad], shape (3,), of a frame in its parent.

`T_a_b` is the pose of frame b in frame a. Matrices of theirs, 3 x 3, are too small for a library
to be fast. Loops, too, where an expression of arrays or the filling of a slice would do: numba
compiles one for half a second, and the error message of the other for three.
"""

import math

import numpy as np
from wasd_core.jit import jit


@jit
def wrap(angle: float) -> float:
    """Return the angle in [-pi, pi) [rad]."""
    wrapped: float = (angle + math.pi) % (2.0 * math.pi) - math.pi
    return wrapped


@jit
def compose(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return T_a_c of T_a_b and T_b_c, shape (3,)."""
    cos, sin = math.cos(first[2]), math.sin(first[2])
    return np.array(
        (
            first[0] + cos * second[0] - sin * second[1],
            first[1] + sin * second[0] + cos * second[1],
            wrap(first[2] + second[2]),
        )
    )


@jit
def inverse(pose: np.ndarray) -> np.ndarray:
    """Return T_b_a of T_a_b, shape (3,)."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return np.array(
        (
            -cos * pose[0] - sin * pose[1],
            sin * pose[0] - cos * pose[1],
            wrap(-pose[2]),
        )
    )


@jit
def transform(pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points of frame b, shape (n, 2) [m], in frame a, by T_a_b."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    moved = np.empty_like(points)
    for index in range(points.shape[0]):
        x, y = points[index]
        moved[index, 0] = pose[0] + cos * x - sin * y
        moved[index, 1] = pose[1] + sin * x + cos * y
    return moved


@jit
def put(into: np.ndarray, row: np.ndarray) -> None:
    """Copy a row into one of its length."""
    for i in range(into.shape[0]):
        into[i] = row[i]


@jit
def sandwich(F: np.ndarray, P: np.ndarray) -> np.ndarray:
    """Return F P F^T of square matrices, which may be larger."""
    size, half, result = len(F), np.zeros_like(F), np.zeros_like(F)
    for i in range(size):
        for j in range(size):
            for k in range(size):
                half[i, j] += F[i, k] * P[k, j]
    for i in range(size):
        for j in range(size):
            for k in range(size):
                result[i, j] += half[i, k] * F[j, k]
    return result


@jit
def add(into: np.ndarray, added: np.ndarray) -> None:
    """Add a matrix to the first rows and columns of one."""
    for i in range(len(added)):
        for j in range(len(added)):
            into[i, j] += added[i, j]


@jit
def turn_axes(P: np.ndarray, yaw: float) -> np.ndarray:
    """
    Return R P R^T with R the rotation of x and y by `yaw` [rad].

    A covariance or an information in the axes of a frame at `yaw` becomes one in its parent's.
    """
    R = np.zeros((3, 3))
    R[0, 0] = R[1, 1] = math.cos(yaw)
    R[2, 2] = 1.0
    R[1, 0] = math.sin(yaw)
    R[0, 1] = -R[1, 0]
    return sandwich(R, P)


@jit
def invert(A: np.ndarray) -> np.ndarray:
    """Return the inverse of a symmetric matrix, by its adjugate; of one that has none, NaN."""
    c00 = A[1, 1] * A[2, 2] - A[1, 2] * A[2, 1]
    c01 = A[1, 2] * A[2, 0] - A[1, 0] * A[2, 2]
    c02 = A[1, 0] * A[2, 1] - A[1, 1] * A[2, 0]
    c11 = A[0, 0] * A[2, 2] - A[0, 2] * A[2, 0]
    c12 = A[0, 1] * A[2, 0] - A[0, 0] * A[2, 1]
    c22 = A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]
    determinant = A[0, 0] * c00 + A[0, 1] * c01 + A[0, 2] * c02
    scale = 1.0 / determinant if determinant != 0.0 else np.nan
    inverse = np.empty((3, 3))
    inverse[0, 0], inverse[1, 1], inverse[2, 2] = scale * c00, scale * c11, scale * c22
    inverse[0, 1] = inverse[1, 0] = scale * c01
    inverse[0, 2] = inverse[2, 0] = scale * c02
    inverse[1, 2] = inverse[2, 1] = scale * c12
    return inverse


@jit
def is_definite(A: np.ndarray) -> bool:
    """Whether a symmetric matrix is positive definite, by its leading minors (Sylvester)."""
    second = A[0, 0] * A[1, 1] - A[0, 1] * A[0, 1]
    third = (
        second * A[2, 2]
        - A[0, 0] * A[1, 2] * A[1, 2]
        - A[1, 1] * A[0, 2] * A[0, 2]
        + 2.0 * A[0, 1] * A[0, 2] * A[1, 2]
    )
    return bool(A[0, 0] > 0.0 and second > 0.0 and third > 0.0)
