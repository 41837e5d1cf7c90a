# SPDX-License-Identifier: Apache-2.0
"""
What feet that stand can carry: the polygon between them, seen from above, and points in it.

Corners are (n, 2) [m], counter-clockwise, three or more.
"""

import math

import numpy as np

from quadruped_sim.robot_state import RobotState

# Legs around the robot, counter-clockwise: FL RL RR FR.
AROUND = np.array((0, 2, 3, 1))
# So often a point is pushed inside all edges, one after the other.
_ROUNDS = 20


def corners_of(feet: np.ndarray, stands: np.ndarray) -> np.ndarray:
    """Return the corners between the `feet` (4, 3) [m] of those that stand, (4,) bool."""
    return np.asarray(feet[AROUND[stands[AROUND]], :2])


def distances_inside(point: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return how far a point (2,) is inside each edge [m], shape (n,); negative outside."""
    return np.asarray(((point - corners) * _normals(corners)).sum(axis=1))


def room_inside(corners: np.ndarray) -> float:
    """Return how far the middle of the corners, a triangle's incentre, is inside all edges [m]."""
    return float(distances_inside(middle_of(corners), corners).min())


def middle_of(corners: np.ndarray) -> np.ndarray:
    """Return the centre of a triangle's incircle, or the mean of more corners, (2,) [m]."""
    if len(corners) != 3:
        return np.asarray(corners.mean(axis=0))
    opposite = np.linalg.norm(np.roll(corners, 1, axis=0) - np.roll(corners, -1, axis=0), axis=1)
    return np.asarray(opposite @ corners / max(float(opposite.sum()), 1e-9))


def nearest_inside(point: np.ndarray, corners: np.ndarray, margin: float) -> np.ndarray:
    """Return a point near `point` (2,) that is `margin` [m] inside all edges, or the middle."""
    if margin >= room_inside(corners):
        return middle_of(corners)
    nearest, normals = point.copy(), _normals(corners)
    for _ in range(_ROUNDS):
        for corner, normal in zip(corners, normals, strict=True):
            nearest += max(margin - float((nearest - corner) @ normal), 0.0) * normal
    return nearest


def is_to_step(robot: RobotState, stands: np.ndarray, gravity: float) -> bool:
    """
    Whether the body moves on beyond the feet that stand, so that only a step can catch it.

    The capture point of the linear inverted pendulum lies outside then [Koolen2012].
    """
    base, com = robot.base, robot.base.R @ robot.com
    # In plain numbers: numpy takes ten times as long for so few.
    cx, cy, cz = com.tolist()
    wx, wy, wz = (base.R @ base.omega).tolist()
    vx, vy, _ = base.velocity.tolist()
    x, y, z = base.position.tolist()
    corners = robot.feet[AROUND[stands[AROUND]]].tolist()
    height = z + cz - sum(foot[2] for foot in corners) / len(corners)
    time = math.sqrt(max(height, 0.0) / gravity)
    x += cx + (vx + wy * cz - wz * cy) * time
    y += cy + (vy + wz * cx - wx * cz) * time
    nexts = (*corners[1:], corners[0])
    return any(
        (bx - ax) * (y - ay) < (by - ay) * (x - ax)
        for (ax, ay, _), (bx, by, _) in zip(corners, nexts, strict=True)
    )


def _normals(corners: np.ndarray) -> np.ndarray:
    """Return the unit normals of the edges from each corner to the next, inward, (n, 2)."""
    edges = np.roll(corners, -1, axis=0) - corners
    lengths = np.maximum(np.linalg.norm(edges, axis=1), 1e-9)
    return np.asarray(np.column_stack((-edges[:, 1], edges[:, 0])) / lengths[:, None])
