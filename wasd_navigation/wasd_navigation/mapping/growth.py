# SPDX-License-Identifier: Apache-2.0
"""How a robot has moved since the last scan by its odometry, and how sure that is."""

import math

import numpy as np

from wasd_navigation.se2 import compose
from wasd_navigation.se2 import inverse

# No odometry is surer than this: variances by way [m^2/m], by turn [rad^2/rad], and of standing.
LEAST_WAY, LEAST_TURN = 1e-6, 1e-6
STANDING = np.diag((1e-8, 1e-8, 1e-8))


class OdometryGrowth:
    """Keeps the last pose and covariance that odometry has given."""

    def __init__(self) -> None:
        self._last: tuple[np.ndarray, np.ndarray] | None = None

    def step(self, pose: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """
        Return the move since the last call, shape (3,), and its covariance, shape (3, 3).

        Both in the base frame before the move. What the covariance in the odom frame has grown
        by is P' - F P F^T, as F carries the error of the heading into the place.
        """
        before = self._last
        self._last = pose.copy(), covariance.copy()
        if before is None:
            return np.zeros(3), np.zeros((3, 3))
        move = compose(inverse(before[0]), pose)
        carried = add_covariance(before[1], before[0], move, np.zeros((3, 3)))
        grown = turn_axes(covariance - carried, -float(before[0][2]))
        # Rounding, or a message that always says the same: nothing shrinks.
        values, vectors = np.linalg.eigh(0.5 * (grown + grown.T))
        grown = (vectors * np.clip(values, 0.0, None)) @ vectors.T
        way, turn = math.hypot(move[0], move[1]), abs(float(move[2]))
        least = LEAST_WAY * way, LEAST_WAY * way, LEAST_TURN * (turn + way)
        return move, grown + np.diag(least) + STANDING


def add_covariance(
    covariance: np.ndarray, pose: np.ndarray, move: np.ndarray, growth: np.ndarray
) -> np.ndarray:
    """
    Return the covariance of a pose after a move: F P F^T + Q.

    `covariance` in the parent's axes at `pose`; `move` and its own covariance `growth` in those of
    the pose.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    F = np.eye(3)
    F[0, 2] = -(sin * move[0] + cos * move[1])
    F[1, 2] = cos * move[0] - sin * move[1]
    added: np.ndarray = F @ covariance @ F.T + turn_axes(growth, float(pose[2]))
    return added


def turn_axes(covariance: np.ndarray, yaw: float) -> np.ndarray:
    """Return a covariance of x, y, yaw in axes turned by -yaw: R P R^T."""
    turn = np.eye(3)
    cos, sin = math.cos(yaw), math.sin(yaw)
    turn[:2, :2] = ((cos, -sin), (sin, cos))
    turned: np.ndarray = turn @ covariance @ turn.T
    return turned
