# SPDX-License-Identifier: Apache-2.0
"""Odometry of the base, with covariances that navigation can use."""

import numpy as np

from quadruped_sim.records import Odometry
from quadruped_sim.robot_state import RobotState

# The IMU's orientation is taken as true up to this variance [rad^2]; its rate likewise.
_ROTATION_VARIANCE = 1e-5
_RATE_VARIANCE = 1e-4


def make_odometry(
    robot: RobotState, position_variance: float, velocity_variance: float
) -> Odometry:
    """Odometry from the estimated state; variances per axis [m^2], [m^2/s^2]."""
    return Odometry(
        position=robot.position,
        orientation=robot.orientation,
        linear_velocity=robot.R.T @ robot.velocity,
        angular_velocity=robot.omega,
        pose_covariance=np.diag([position_variance] * 3 + [_ROTATION_VARIANCE] * 3),
        twist_covariance=np.diag([velocity_variance] * 3 + [_RATE_VARIANCE] * 3),
    )
