# SPDX-License-Identifier: Apache-2.0
"""
Poses in the plane: arrays (x, y, yaw) [m], [m], [rad], shape (3,), of a frame in its parent.

`T_a_b` is the pose of frame b in frame a.
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
