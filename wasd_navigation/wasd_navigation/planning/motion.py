# SPDX-License-Identifier: Apache-2.0
"""How a base moves on a command, where it then is, and how far from obstacles."""

import math
from typing import NamedTuple

import numpy as np

from wasd_navigation.parameters import DriveLimits
from wasd_navigation.planning.distances import fast, Field, look_up
from wasd_navigation.se2 import compose, wrap

# Time constant in which a pose that the velocity does not explain is believed [s]; and the
# difference [m or rad] that is no noise, but another place.
_TIME, _JUMP = 0.3, 0.15
# Of the margin, what a way and a motion must have everywhere; with less than all they are dear.
HARD = 0.75
# And where there is no other way, as in a gap that it has come through.
IN_GAP = 0.25


class Base(NamedTuple):
    """What a base can do: bounds of (vx, vy, wz), of their change, and its lag [s]."""

    most: np.ndarray  # (3,) [m/s, m/s, rad/s]
    least: np.ndarray  # (3,)
    change: np.ndarray  # (3,) [m/s^2, m/s^2, rad/s^2]
    lag: float
    is_omni: bool


def base_of(limits: DriveLimits) -> Base:
    """Return a base with these limits."""
    return Base(
        np.array((limits.forward, limits.lateral, limits.yaw)),
        np.array((-limits.backward, -limits.lateral, -limits.yaw)),
        np.array(
            (limits.forward_acceleration, limits.lateral_acceleration, limits.yaw_acceleration)
        ),
        limits.lag,
        limits.lateral > 0.0,
    )


@fast
def move(state: np.ndarray, asked: np.ndarray, base: Base, dt: float) -> None:
    """Advance (x, y, yaw, vx, vy, wz), shape (6,), by `dt` [s] of a velocity asked for, (3,)."""
    share = dt / max(base.lag, dt)
    for axis in range(3):
        wanted = min(max(asked[axis], base.least[axis]), base.most[axis])
        most = base.change[axis] * dt
        step = (wanted - state[3 + axis]) * share
        state[3 + axis] += min(max(step, -most), most)
    yaw = state[2] + 0.5 * dt * state[5]
    cos, sin = math.cos(yaw), math.sin(yaw)
    state[0] += dt * (cos * state[3] - sin * state[4])
    state[1] += dt * (sin * state[3] + cos * state[4])
    state[2] += dt * state[5]


@fast
def least_clearance(
    distances: Field, circles: np.ndarray, way: np.ndarray, enough: float
) -> float:
    """Return the least clearance [m] on a way (x, y, yaw), shape (n, 3)."""
    least: float = enough
    for index in range(way.shape[0]):
        least = min(least, clearance(distances, circles, way[index], enough))
    return least


@fast
def clearance(distances: Field, circles: np.ndarray, state: np.ndarray, enough: float) -> float:
    """
    Return the distance [m] from the footprint at (x, y, yaw, ...) to what is nearest.

    Exact up to `enough` only; beyond it, something beyond it. Negative: it touches.
    """
    at_middle: float = look_up(distances, 0, state[0], state[1])
    reach: float = math.hypot(circles[0, 0], circles[0, 1]) + circles[0, 2]
    if circles.shape[0] == 1 or at_middle - reach >= enough:
        return at_middle - reach
    cos, sin = math.cos(state[2]), math.sin(state[2])
    least = at_middle
    for index in range(circles.shape[0]):
        x = state[0] + cos * circles[index, 0] - sin * circles[index, 1]
        y = state[1] + sin * circles[index, 0] + cos * circles[index, 1]
        least = min(least, look_up(distances, 0, x, y) - circles[index, 2])
    return least


class PoseFilter:
    """
    A pose without its noise, which would shake the robot.

    `pose`, shape (3,), follows the velocity, and slowly what poses say; None at first.
    """

    def __init__(self) -> None:
        self.pose: np.ndarray | None = None

    def step(self, pose: np.ndarray, velocity: np.ndarray, dt: float) -> None:
        """Take a pose and the velocity in the base frame, shape (3,), after `dt` [s]."""
        if self.pose is None:
            self.pose = np.array(pose, float)
            return
        foreseen = compose(self.pose, velocity * dt)
        error = pose - foreseen
        error[2] = wrap(error[2])
        is_elsewhere = math.hypot(error[0], error[1]) > _JUMP or abs(error[2]) > _JUMP
        share = 1.0 if is_elsewhere else min(dt / _TIME, 1.0)
        blended: np.ndarray = foreseen + share * error
        self.pose = blended
