# SPDX-License-Identifier: Apache-2.0
"""What is known at one tick, estimated once for all parts, and the odometry made of it."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from quadruped_sim.leg_kinematics import ContactPoints
from quadruped_sim.leg_kinematics import LegMotion
from quadruped_sim.robot_model import Dynamics


class BaseMotion(NamedTuple):
    """
    Where the base is and how it moves.

    `position` [m] and `velocity` [m/s] are in the world, `R` (3, 3) turns base axes into it,
    `rpy` says the same [rad]; `omega` [rad/s] is in base axes.
    """

    position: np.ndarray
    velocity: np.ndarray
    R: np.ndarray
    rpy: np.ndarray
    omega: np.ndarray


@dataclass(frozen=True)
class RobotState:
    """
    Estimated state of one tick.

    `orientation` (w, x, y, z) says what `base.R` says. `feet` (4, 3) are the foot centres in the
    world and `com` (3,) the centre of mass in base axes. `normal_forces` (4,) [N] are estimated
    from the joint torques, `is_contact` (4,) follows from them.
    """

    joint_position: np.ndarray
    joint_velocity: np.ndarray
    orientation: np.ndarray
    base: BaseMotion
    motion: LegMotion
    contact: ContactPoints
    dynamics: Dynamics
    feet: np.ndarray
    com: np.ndarray
    normal_forces: np.ndarray
    is_contact: np.ndarray


@dataclass(frozen=True)
class LegOdometry:
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


# The IMU's orientation is taken as true up to this variance [rad^2]; its rate likewise.
_ROTATION_VARIANCE = 1e-5
_RATE_VARIANCE = 1e-4


def make_odometry(
    robot: RobotState, position_variance: float, velocity_variance: float
) -> LegOdometry:
    """LegOdometry from the estimated state; variances per axis [m^2], [m^2/s^2]."""
    return LegOdometry(
        position=robot.base.position,
        orientation=robot.orientation,
        linear_velocity=robot.base.R.T @ robot.base.velocity,
        angular_velocity=robot.base.omega,
        pose_covariance=np.diag([position_variance] * 3 + [_ROTATION_VARIANCE] * 3),
        twist_covariance=np.diag([velocity_variance] * 3 + [_RATE_VARIANCE] * 3),
    )
