# SPDX-License-Identifier: Apache-2.0
"""Records between simulator and controller: readings, commands, the base's state."""

from collections.abc import Sequence
import math
from typing import NamedTuple

import numpy as np

# What controllers reckon with and MuJoCo's worlds have [m/s^2].
GRAVITY = 9.81
# The physics' step [s].
TIME_STEP = 0.001
# How often a leg controller steps [Hz], and so how often it wants the state.
LEG_RATE = 500.0
# A motor gives its full torque up to this share of its no-load speed, then linearly less, to none.
FULL_TORQUE_SHARE = 0.6
# No motor is told more than this: beyond 1e10 MuJoCo zeroes what all motors are told.
MOST_CONTROL = 1e9


class BaseState(NamedTuple):
    """The robot's root frame as physics knows it; without sensor noise."""

    position: np.ndarray  # p_world_base [m], shape (3,)
    orientation: np.ndarray  # quaternion w, x, y, z of R_world_base, shape (4,)
    linear_velocity: np.ndarray  # in the world frame [m/s], shape (3,)
    angular_velocity: np.ndarray  # in the base frame [rad/s], shape (3,)

    @property
    def rpy(self) -> np.ndarray:
        """Roll, pitch, yaw [rad], shape (3,); R = Rz(yaw) Ry(pitch) Rx(roll)."""
        return np.array(self._angles())

    def _angles(self) -> tuple[float, float, float]:
        # In plain numbers: numpy takes ten times as long for one of these.
        w, x, y, z = self.orientation.tolist()
        roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
        yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        return roll, pitch, yaw

    @property
    def tilt(self) -> float:
        """Angle between the base's z axis and the world's [rad]."""
        _, x, y, _ = self.orientation.tolist()
        return math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y))))

    @property
    def planar_velocity(self) -> np.ndarray:
        """Velocity ahead and to the left [m/s] by yaw, and turn about world z [rad/s], (3,)."""
        roll, pitch, yaw = self._angles()
        vx, vy, _ = self.linear_velocity.tolist()
        p, q, r = self.angular_velocity.tolist()
        cos, sin = math.cos(yaw), math.sin(yaw)
        # The third row of Rz(yaw) Ry(pitch) Rx(roll), which yaw does not change.
        turn = math.cos(pitch) * (math.sin(roll) * q + math.cos(roll) * r) - math.sin(pitch) * p
        return np.array([cos * vx + sin * vy, cos * vy - sin * vx, turn])


class BaseOdometry(NamedTuple):
    """
    A robot's estimate of its base.

    `position` [m] in odom, `orientation` (w, x, y, z) base to odom; `linear_velocity` [m/s] and
    `angular_velocity` [rad/s] in base axes. Covariances are (6, 6): xyz then rotation about xyz.
    """

    position: np.ndarray
    orientation: np.ndarray
    linear_velocity: np.ndarray
    angular_velocity: np.ndarray
    pose_covariance: np.ndarray
    twist_covariance: np.ndarray


class JointStates(NamedTuple):
    """Joints in a known order, each array of shape (n,)."""

    position: np.ndarray  # [rad]
    velocity: np.ndarray  # [rad/s]
    effort: np.ndarray  # [N m], of the last physics step; 0 without a motor


class ImuReading(NamedTuple):
    """The IMU in the root's axes: quaternion w, x, y, z; [rad/s]; specific force [m/s^2]."""

    orientation: np.ndarray
    angular_velocity: np.ndarray
    linear_acceleration: np.ndarray


class Senses(NamedTuple):
    """
    The input of a walker: the robot's own readings; joints in the walker's order, (n,).

    `orientation` is a quaternion w, x, y, z from base to world; velocities of the base are in its
    own axes [m/s], [rad/s]; joints [rad], [rad/s].
    """

    orientation: np.ndarray
    angular_velocity: np.ndarray
    linear_velocity: np.ndarray
    joint_position: np.ndarray
    joint_velocity: np.ndarray


class JointTargets(NamedTuple):
    """Joint targets [rad] and gains [N m/rad], [N m s/rad]; (n,) each."""

    position: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray


def command_bounds(ranges: Sequence[tuple[float, float]] | None) -> np.ndarray:
    """
    Return the least and the largest command that a walker is given, (2, 3).

    They are the ranges of its training, and 0: the command where nobody drives, even if training
    never had it. Without ranges they are infinite.
    """
    if ranges is None:
        return np.array(((-math.inf,) * 3, (math.inf,) * 3))
    low, high = np.array(ranges).T
    return np.stack((np.minimum(low, 0.0), np.maximum(high, 0.0)))


class Reading(NamedTuple):
    """Everything measured in one instant; `imu` is None for a robot without one."""

    joints: JointStates
    imu: ImuReading | None


class JointCommand(NamedTuple):
    """
    Motors in a known order, each array of shape (m,).

    The motor applies `effort + kp (position - q) + kd (velocity - v)` [N m], clipped to its limit,
    at every physics step.
    """

    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    kp: np.ndarray
    kd: np.ndarray


def is_finite(numbers: np.ndarray) -> bool:
    """Whether all numbers are finite; fast where they are."""
    # A product tells in one call of most, but overflows where numbers are large.
    return math.isfinite(float(np.vdot(numbers, numbers))) or bool(np.isfinite(numbers).all())
