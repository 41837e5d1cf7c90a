# SPDX-License-Identifier: Apache-2.0
"""Holds the base at a pose over feet that do not step, by the whole-body QP."""

import numpy as np

from quadruped_sim.parameters import BalanceParameters
from quadruped_sim.robot_state import RobotState
from quadruped_sim.rotations import matrix_from_rpy
from quadruped_sim.rotations import rotation_vector


def base_acceleration(
    params: BalanceParameters,
    state: RobotState,
    position: np.ndarray,
    rpy: np.ndarray,
) -> np.ndarray:
    """
    Acceleration (6,) that brings the base to rest at a pose: linear then angular, world axes.

    `position` (3,) [m] and `rpy` (3,) [rad] are in the world. Each axis is limited.
    """
    linear = np.array(params.position_gains) * (position - state.position)
    linear -= np.array(params.velocity_gains) * state.velocity
    R_wanted = matrix_from_rpy(*rpy.tolist())
    error = rotation_vector(R_wanted @ state.R.T)
    angular = np.array(params.rotation_gains) * error
    angular -= np.array(params.rate_gains) * (state.R @ state.omega)
    return np.concatenate(
        (
            np.clip(linear, -params.acceleration_max, params.acceleration_max),
            np.clip(angular, -params.rotation_max, params.rotation_max),
        )
    )


def standing_forces(weight: float, is_stance: np.ndarray) -> np.ndarray:
    """Weight [N] shared evenly by the standing feet, shape (4, 3), world axes."""
    forces = np.zeros((4, 3))
    forces[is_stance, 2] = weight / max(int(is_stance.sum()), 1)
    return forces
