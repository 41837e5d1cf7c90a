# SPDX-License-Identifier: Apache-2.0
"""Where a frame is in another, and URDF's rotations."""

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
    x, y, z = np.eye(3)
    rotation: np.ndarray = axis_angle(z, yaw) @ axis_angle(y, pitch) @ axis_angle(x, roll)
    return rotation
