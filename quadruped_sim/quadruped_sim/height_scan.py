# SPDX-License-Identifier: Apache-2.0
"""The heights around a robot that policies are trained with, in their order and their frame."""

from collections.abc import Callable

import numpy as np
from wasd_core.rotations import yaw_of

# Of Isaac Lab's and mjlab's rough terrains: 1.6 x 1.0 m about the base, 0.1 m apart.
LENGTH, WIDTH, APART = 1.6, 1.0, 0.1
COLUMNS, ROWS = round(LENGTH / APART) + 1, round(WIDTH / APART) + 1
# What is taken off a height of the base in training [m].
OFFSET = 0.5

# Heights [m] at x and y of one shape, NaN where unknown.
Heights = Callable[[np.ndarray, np.ndarray], np.ndarray]


def scan_places(position: np.ndarray, yaw: float) -> np.ndarray:
    """
    Return where a height scan looks, (187, 2) [m], in the frame in which the base is.

    The grid is level, turned with the base's `yaw` [rad] alone, x fastest, from behind on the
    right to ahead on the left.
    """
    x = np.linspace(-0.5 * LENGTH, 0.5 * LENGTH, COLUMNS)
    y = np.linspace(-0.5 * WIDTH, 0.5 * WIDTH, ROWS)
    ahead, left = (part.ravel() for part in np.meshgrid(x, y))
    cos, sin = np.cos(yaw), np.sin(yaw)
    turned = np.stack((cos * ahead - sin * left, sin * ahead + cos * left), axis=1)
    return np.asarray(np.asarray(position)[:2] + turned)


def height_scan(heights: Heights, position: np.ndarray, yaw: float) -> np.ndarray:
    """
    Return how far the base is above the ground at `scan_places`, less `OFFSET`, (187,) [m].

    `heights` tells the ground in the frame of the base's position (3,) [m]: `Elevation.at`, or
    the true one of a simulator. Unknown values are NaN.
    """
    x, y = scan_places(position, yaw).T
    return np.asarray(position[2] - heights(x, y) - OFFSET)


def known_scan(
    heights: Heights, position: np.ndarray, orientation: np.ndarray, height: float
) -> np.ndarray:
    """
    Return the height scan (187,) [m] of a base at a position (3,) and orientation (w, x, y, z).

    Unknown ground counts as level, `height` [m] below the base.
    """
    yaw = yaw_of(orientation)
    seen = height_scan(heights, position, yaw)
    return np.where(np.isnan(seen), height - OFFSET, seen)
