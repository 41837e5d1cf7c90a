# SPDX-License-Identifier: Apache-2.0
"""
Small algebra of one tick: rotations in plain floats, and loops that numba compiles.

numba compiles `numpy.linalg` and `@` for seconds per function; these loops take a tenth of that
and are as fast for sizes up to 6. Quaternions are (w, x, y, z).
"""

from collections.abc import Callable
import math
from typing import cast, ParamSpec, TypeVar

import numba
import numpy as np

_P = ParamSpec('_P')
_R = TypeVar('_R')


def jit(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` on its first call; the result is cached on disk where possible."""
    try:
        return cast('Callable[_P, _R]', numba.njit(cache=True)(function))
    except RuntimeError:  # neither the package's folder nor a user cache can be written
        return cast('Callable[_P, _R]', numba.njit(function))


@jit
def rotate(R: np.ndarray, v: np.ndarray) -> np.ndarray:
    """R v for a (3, 3) matrix and a (3,) vector."""
    out = np.empty(3)
    for i in range(3):
        out[i] = R[i, 0] * v[0] + R[i, 1] * v[1] + R[i, 2] * v[2]
    return out


@jit
def rotate_back(R: np.ndarray, v: np.ndarray) -> np.ndarray:
    """R' v for a (3, 3) matrix and a (3,) vector."""
    out = np.empty(3)
    for i in range(3):
        out[i] = R[0, i] * v[0] + R[1, i] * v[1] + R[2, i] * v[2]
    return out


@jit
def cross3(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a x b, (3,)."""
    out = np.empty(3)
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return out


@jit
def invert3(A: np.ndarray) -> np.ndarray:
    """Inverse of a (3, 3) matrix by cofactors; a singular one gives infinities."""
    out = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            c, d = (j + 1) % 3, (j + 2) % 3
            out[j, i] = A[a, c] * A[b, d] - A[a, d] * A[b, c]
    determinant = A[0, 0] * out[0, 0] + A[0, 1] * out[1, 0] + A[0, 2] * out[2, 0]
    scale = 1.0 / determinant if determinant != 0.0 else np.inf
    for i in range(3):
        for j in range(3):
            out[i, j] *= scale
    return out


@jit
def solve_in_place(A: np.ndarray, B: np.ndarray) -> None:
    """Replace `B` (n, m) by A^-1 B; `A` (n, n) is symmetric positive definite and is destroyed."""
    n, m = B.shape
    for k in range(n):  # elimination without pivoting is stable for such matrices
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            for j in range(k + 1, n):
                A[i, j] -= factor * A[k, j]
            for j in range(m):
                B[i, j] -= factor * B[k, j]
    for j in range(m):
        for i in range(n - 1, -1, -1):
            total = B[i, j]
            for k in range(i + 1, n):
                total -= A[i, k] * B[k, j]
            B[i, j] = total / A[i, i]


def matrix_from_quaternion(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrix (3, 3) of a quaternion (w, x, y, z), which is normalised first."""
    w, x, y, z = quaternion.tolist()
    s = 2.0 / (w * w + x * x + y * y + z * z)
    return np.array(
        (
            (1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)),
            (s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)),
            (s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)),
        )
    )


def rpy_from_matrix(R: np.ndarray) -> np.ndarray:
    """Roll, pitch, yaw [rad] of R = Rz(yaw) Ry(pitch) Rx(roll), shape (3,)."""
    (r00, _, _), (r10, _, _), (r20, r21, r22) = R.tolist()
    return np.array(
        (math.atan2(r21, r22), math.asin(max(-1.0, min(1.0, -r20))), math.atan2(r10, r00))
    )


def matrix_from_rpy(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Rotation matrix Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3)."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        (
            (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
            (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
            (-sp, cp * sr, cp * cr),
        )
    )


def yaw_matrix(yaw: float) -> np.ndarray:
    """Rotation about z, shape (3, 3)."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))


def quaternion_from_rpy(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Quaternion (w, x, y, z) of Rz(yaw) Ry(pitch) Rx(roll)."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return np.array(
        (
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        )
    )


def skew(vector: np.ndarray) -> np.ndarray:
    """Matrix (3, 3) whose product with b is the cross product of `vector` and b."""
    x, y, z = vector.tolist()
    return np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product of two (3,) vectors; ten times faster than `numpy.cross`."""
    ax, ay, az = a.tolist()
    bx, by, bz = b.tolist()
    return np.array((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx))


def rotation_vector(R: np.ndarray) -> np.ndarray:
    """
    Axis times angle [rad] of a rotation matrix, shape (3,).

    Good for errors below 180 degrees, where the axis is unique.
    """
    sine = 0.5 * np.array((R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]))
    s = math.sqrt(float(sine @ sine))
    if s < 1e-9:
        return sine
    cosine = 0.5 * (float(R[0, 0] + R[1, 1] + R[2, 2]) - 1.0)
    return sine * (math.atan2(s, cosine) / s)


def wrap_angle(angle: float) -> float:
    """Return `angle` moved into (-pi, pi]."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)
