# SPDX-License-Identifier: Apache-2.0
"""What goes into and comes out of the controller; leg angles in `LEGS` order, SI, REP 103."""

from dataclasses import dataclass
from dataclasses import field

import numpy as np


@dataclass(frozen=True)
class BaseState:
    """
    Motion of the base link, whose origin is at `position`.

    `position` [m] and `velocity` [m/s] are in world axes, `orientation` is the quaternion
    (w, x, y, z) from base to world, `angular_velocity` [rad/s] is in base axes.
    """

    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray


@dataclass(frozen=True)
class Sensors:
    """
    One reading of the robot.

    Joint arrays are (12,): [rad], [rad/s], [N m]. The IMU gives its orientation as a quaternion
    (w, x, y, z) to a level world, its angular velocity [rad/s] and its specific force [m/s^2]
    (+g when at rest) in base axes. `truth` feeds the estimator called `truth`.
    """

    joint_position: np.ndarray
    joint_velocity: np.ndarray
    joint_effort: np.ndarray
    imu_orientation: np.ndarray
    imu_angular_velocity: np.ndarray
    imu_linear_acceleration: np.ndarray
    truth: BaseState | None = None


def _zeros() -> np.ndarray:
    return np.zeros(12)


@dataclass(frozen=True)
class LegCommand:
    """
    What the motors hold until the next command, each (12,).

    effort = `effort` + kp (position - q) + kd (velocity - dq), evaluated at every physics step.
    """

    position: np.ndarray = field(default_factory=_zeros)
    velocity: np.ndarray = field(default_factory=_zeros)
    effort: np.ndarray = field(default_factory=_zeros)
    kp: np.ndarray = field(default_factory=_zeros)
    kd: np.ndarray = field(default_factory=_zeros)


@dataclass(frozen=True)
class Odometry:
    """
    Pose and velocity of the base for navigation.

    `position` [m] in odom, `orientation` (w, x, y, z) base to odom; `linear_velocity` [m/s] and
    `angular_velocity` [rad/s] in base axes. Covariances are (6, 6): xyz then rotation about xyz.
    """

    position: np.ndarray
    orientation: np.ndarray
    linear_velocity: np.ndarray
    angular_velocity: np.ndarray
    pose_covariance: np.ndarray
    twist_covariance: np.ndarray
