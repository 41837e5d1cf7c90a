# SPDX-License-Identifier: Apache-2.0
"""Odometry of the last seconds: pose at a scan, motion and covariance."""

from collections import deque
import math
from typing import NamedTuple

import numpy as np
from wasd_core.errors import InvalidMessage
from wasd_core.jit import jit
from wasd_core.robot_io import BaseOdometry
from wasd_core.rotations import matrix_from_quaternion, Pose, rpy_from_matrix, yaw_matrix

from wasd_navigation.se2 import add, compose, inverse, is_definite, sandwich, turn_axes, wrap

# So many are remembered: two seconds at 50 Hz.
REMEMBERED = 100
# No odometry is surer than this: variances by way [m^2/m], by turn [rad^2/rad], and of standing.
LEAST_WAY, LEAST_TURN, STANDING = 1e-6, 1e-6, 1e-8
# What is not known of the move in which odometry was set again [m^2], [rad^2].
LEAP = np.diag((0.05**2, 0.05**2, 0.05**2))
# Odometry that has moved more than this, and than so fast, has been set again [m], [rad], [m/s].
LEAP_WAY, LEAP_TURN, LEAP_RATE = 1.0, 2.0, 10.0
# Nothing drives so far [m] or so fast [m/s, rad/s].
FARTHEST, FASTEST = 1e6, 1e3
# What a longer quaternion says, or one shorter than its inverse, is noise.
LONGEST_QUATERNION = 1e3
# x, y and yaw in a covariance of x, y, z, roll, pitch, yaw, shape (6, 6).
PLANAR = np.ix_((0, 1, 5), (0, 1, 5))


class Odometry(NamedTuple):
    """
    The base in the odom frame as seen from above.

    `pose` is T_odom_base, shape (3,) [m, m, rad], `velocity` (vx, vy, wz) is in the base frame,
    `covariance`, shape (3, 3), is the pose's. `level` is the base in the level frame below it,
    whose origin is at the height of the odom frame's and whose x is ahead.
    """

    pose: np.ndarray
    velocity: np.ndarray
    covariance: np.ndarray
    level: Pose


def leaps(before: np.ndarray, after: np.ndarray, dt: float) -> bool:
    """Return whether odometry was set again between two poses, shape (3,), `dt` [s] apart."""
    move = compose(inverse(before), after)
    way, free = math.hypot(move[0], move[1]), LEAP_RATE * dt
    return bool(way > LEAP_WAY + free or abs(move[2]) > LEAP_TURN + free)


def read_odometry(base: BaseOdometry) -> Odometry:
    """
    Return odometry as seen from above.

    Raises:
        InvalidMessage: a number is not finite, or is out of the world.
    """
    pose = read_pose(base.position, base.orientation)
    planar = to_planar(pose)
    level = Pose(
        np.array([0.0, 0.0, pose.position[2]]), yaw_matrix(-float(planar[2])) @ pose.rotation
    )
    velocity = np.array([*base.linear_velocity[:2], base.angular_velocity[2]])
    if not (np.abs(velocity) <= FASTEST).all():
        raise InvalidMessage(f'wanted a velocity of at most {FASTEST:.0f} m/s, got {velocity}')
    return Odometry(planar, velocity, read_covariance(base.pose_covariance), level)


def read_pose(position: np.ndarray, quaternion: np.ndarray) -> Pose:
    """
    Return a pose of a place (3,) [m] and an orientation w, x, y, z.

    Raises:
        InvalidMessage: a number is not finite, a place out of the world, the orientation 0.
    """
    length = math.hypot(*quaternion)
    is_finite = all(map(math.isfinite, (*position, *quaternion)))
    if not is_finite or not length > 1.0 / LONGEST_QUATERNION:
        raise InvalidMessage('wanted a pose of finite numbers and an orientation that is not 0')
    if max(map(abs, position)) > FARTHEST or length > LONGEST_QUATERNION:
        raise InvalidMessage(f'wanted a pose within {1e-3 * FARTHEST:.0f} km, of unit orientation')
    return Pose(position, matrix_from_quaternion(quaternion))


def to_planar(pose: Pose) -> np.ndarray:
    """Return x, y [m] and yaw [rad] of a pose, shape (3,)."""
    return np.array([*pose.position[:2], rpy_from_matrix(pose.rotation)[2]])


def read_covariance(covariance: np.ndarray) -> np.ndarray:
    """
    Return the covariance of x, y and yaw, shape (3, 3), out of that of a pose, shape (6, 6).

    Raises:
        InvalidMessage: a number of it is not finite.
    """
    planar: np.ndarray = covariance[PLANAR]
    if not np.isfinite(planar).all():
        raise InvalidMessage('wanted a covariance of finite numbers')
    bounded: np.ndarray = planar.clip(-(FARTHEST**2), FARTHEST**2)
    return bounded


class OdometryMemory:
    """Odometry by its stamps [s]."""

    def __init__(self) -> None:
        self._known: deque[tuple[float, Odometry]] = deque(maxlen=REMEMBERED)

    def add(self, stamp: float, odometry: Odometry) -> None:
        """Remember odometry; when time jumps back, nothing else."""
        if self._known and stamp < self._known[-1][0]:
            self._known.clear()
        self._known.append((stamp, odometry))

    def at(self, stamp: float) -> Odometry | None:
        """Return odometry of an instant, between two; None where that is not known, or not yet."""
        if not self._known or not self._known[0][0] <= stamp <= self._known[-1][0]:
            return None
        after = next(index for index, (time, _) in enumerate(self._known) if time >= stamp)
        (end, late), (begin, early) = self._known[after], self._known[max(after - 1, 0)]
        if end <= begin:
            return late
        turn = wrap(late.pose[2] - early.pose[2])
        step = np.array([*(late.pose[:2] - early.pose[:2]), turn])
        pose = early.pose + (stamp - begin) / (end - begin) * step
        return late._replace(pose=np.array([pose[0], pose[1], wrap(pose[2])]))

    def poses(self, stamps: np.ndarray) -> np.ndarray:
        """Return poses at instants, shape (n, 3), those before all that is known as the first."""
        times = np.array([time for time, _ in self._known])
        known = np.array([odometry.pose for _, odometry in self._known])
        yaws = np.unwrap(known[:, 2])
        values = (known[:, 0], known[:, 1], yaws)
        return np.stack([np.interp(stamps, times, value) for value in values], axis=1)

    def age(self, stamp: float) -> float:
        """Return how long before the newest odometry an instant was [s]; NaN: there is none."""
        return self._known[-1][0] - stamp if self._known else math.nan

    @property
    def oldest(self) -> float:
        """When the oldest odometry was that is kept [s]; never, if there is none."""
        return self._known[0][0] if self._known else -math.inf

    def clear(self) -> None:
        """Forget everything."""
        self._known.clear()


def moves_between(pose: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return other poses, shape (n, 3), in the frame of one, shape (3,)."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = others[:, 0] - pose[0], others[:, 1] - pose[1]
    turns = (others[:, 2] - pose[2] + math.pi) % (2.0 * math.pi) - math.pi
    return np.stack((cos * dx + sin * dy, -sin * dx + cos * dy, turns), axis=1)


class OdometryGrowth:
    """Keeps the last pose and covariance that odometry has given."""

    def __init__(self) -> None:
        self._last: tuple[np.ndarray, np.ndarray] | None = None

    def step(self, pose: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """
        Return the move since the last call, shape (3,), and its covariance, shape (3, 3).

        Both in the base frame before the move.
        """
        before = self._last
        self._last = pose.copy(), covariance.copy()
        if before is None:
            return np.zeros(3), np.zeros((3, 3))
        move: np.ndarray = compose(inverse(before[0]), pose)
        return move, _grow(*before, move, covariance)


@jit
def _grow(pose: np.ndarray, before: np.ndarray, move: np.ndarray, after: np.ndarray) -> np.ndarray:
    """
    Return what the covariance in the odom frame has grown by, in the axes of `pose`.

    That is P' - F P F^T, as F carries the error of the heading into the place. What has shrunk,
    as by rounding or in a message that always says the same, has not grown.
    """
    carried = add_covariance(before, pose, move, np.zeros((3, 3)))
    for i in range(3):
        for j in range(3):
            carried[i, j] = after[i, j] - carried[i, j]
    grown = turn_axes(carried, -pose[2])
    way, turn = math.hypot(move[0], move[1]), abs(move[2])
    place, heading = LEAST_WAY * way + STANDING, LEAST_TURN * (turn + way) + STANDING
    least = (place, place, heading)
    for i in range(3):
        grown[i, i] += least[i]
    if not is_definite(grown):
        for i in range(3):
            for j in range(3):
                grown[i, j] = max(least[i], grown[i, j]) if i == j else 0.0
    return grown


@jit
def add_covariance(
    covariance: np.ndarray, pose: np.ndarray, move: np.ndarray, growth: np.ndarray
) -> np.ndarray:
    """
    Return the covariance of a pose after a move: F P F^T + Q.

    `covariance` in the parent's axes at `pose`; `move` and its own covariance `growth` in those
    of the pose.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    F = np.eye(3)
    F[0, 2] = -(sin * move[0] + cos * move[1])
    F[1, 2] = cos * move[0] - sin * move[1]
    carried = sandwich(F, covariance)
    add(carried, turn_axes(growth, pose[2]))
    return carried
