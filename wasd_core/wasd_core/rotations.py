# SPDX-License-Identifier: Apache-2.0
"""
Where a frame is in another, and all rotations: matrices (3, 3), quaternions (w, x, y, z), angles.

In plain floats: numpy takes ten times as long for sizes like these.
"""

from dataclasses import dataclass
import math

import numpy as np


@dataclass(frozen=True)
class Pose:
    """Position [m], shape (3,), and rotation matrix, shape (3, 3), of a frame in its parent."""

    position: np.ndarray
    rotation: np.ndarray

    def __matmul__(self, other: 'Pose') -> 'Pose':
        """Compose: `T_a_b @ T_b_c` is `T_a_c`."""
        return Pose(self.position + self.rotation @ other.position, self.rotation @ other.rotation)


@dataclass(frozen=True)
class Origin(Pose):
    """A pose as a URDF's `origin` has it, with its angles roll, pitch and yaw [rad]."""

    rpy: tuple[float, float, float]


IDENTITY = Pose(np.zeros(3), np.eye(3))
NO_ORIGIN = Origin(np.zeros(3), np.eye(3), (0.0, 0.0, 0.0))


def axis_angle(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the rotation by `angle` [rad] about a unit axis (Rodrigues), shape (3, 3)."""
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation: np.ndarray = np.eye(3) + math.sin(angle) * skew
    rotation += (1.0 - math.cos(angle)) * skew @ skew
    return rotation


def rpy_matrix(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Return URDF's fixed-axis rotation Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3)."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        (
            (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
            (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
            (0.0 - sp, cp * sr, cp * cr),
        )
    )


def yaw_matrix(yaw: float) -> np.ndarray:
    """Rotation about z, shape (3, 3)."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))


def rpy_from_matrix(R: np.ndarray) -> np.ndarray:
    """Roll, pitch, yaw [rad] of R = Rz(yaw) Ry(pitch) Rx(roll), shape (3,)."""
    (r00, _, _), (r10, _, _), (r20, r21, r22) = R.tolist()
    return np.array(
        (math.atan2(r21, r22), math.asin(max(-1.0, min(1.0, -r20))), math.atan2(r10, r00))
    )


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


def yaw_of(quaternion: np.ndarray) -> float:
    """Return the yaw [rad] of a quaternion (w, x, y, z), as `rpy_from_matrix` has it."""
    w, x, y, z = quaternion.tolist()
    s = 2.0 / (w * w + x * x + y * y + z * z)
    return math.atan2(s * (x * y + w * z), 1.0 - s * (y * y + z * z))


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


def to_quaternion(rotation: np.ndarray) -> tuple[float, float, float, float]:
    """Return the unit quaternion w, x, y, z, w >= 0, of a rotation matrix (Shepperd 1978)."""
    m = rotation.tolist()
    trace = m[0][0] + m[1][1] + m[2][2]
    candidates = [trace, m[0][0], m[1][1], m[2][2]]
    largest = candidates.index(max(candidates))
    if largest == 0:
        w = 0.5 * math.sqrt(1.0 + trace)
        s = 0.25 / w
        q = [w, s * (m[2][1] - m[1][2]), s * (m[0][2] - m[2][0]), s * (m[1][0] - m[0][1])]
    else:
        i = largest - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        value = 0.5 * math.sqrt(1.0 + m[i][i] - m[j][j] - m[k][k])
        s = 0.25 / value
        q = [s * (m[k][j] - m[j][k]), 0.0, 0.0, 0.0]
        q[1 + i] = value
        q[1 + j] = s * (m[j][i] + m[i][j])
        q[1 + k] = s * (m[k][i] + m[i][k])
    sign = 1.0 if q[0] >= 0.0 else -1.0
    return sign * q[0], sign * q[1], sign * q[2], sign * q[3]


def rotate_inverse(orientation: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Return a world-frame vector in the frame of a quaternion (w, x, y, z), shape (3,)."""
    # In plain numbers: np.cross takes 20 us for one of these. With q the vector part of the
    # inverse and u = q x v, the result is v + 2 (w u + q x u).
    w, x, y, z = orientation.tolist()
    a, b, c = vector.tolist()
    d, e, f = z * b - y * c, x * c - z * a, y * a - x * b
    return np.array(
        [
            a + 2.0 * (w * d + z * e - y * f),
            b + 2.0 * (w * e + x * f - z * d),
            c + 2.0 * (w * f + y * d - x * e),
        ]
    )


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product of two (3,) vectors; ten times faster than `numpy.cross`."""
    ax, ay, az = a.tolist()
    bx, by, bz = b.tolist()
    return np.array((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx))
