# SPDX-License-Identifier: Apache-2.0
"""Base acceleration to ask of the whole-body QP in trot: the MPC's plus feedback every tick."""

import numpy as np

from quadruped_sim.jit import jit
from quadruped_sim.parameters import WholeBodyParameters
from quadruped_sim.reference import BaseReference
from quadruped_sim.robot_model import RobotModel
from quadruped_sim.robot_state import RobotState
from quadruped_sim.rotations import matrix_from_rpy
from quadruped_sim.rotations import rotation_vector
from quadruped_sim.small_matrix import cross3
from quadruped_sim.small_matrix import rotate
from quadruped_sim.small_matrix import rotate_back


class BaseTracking:
    """Rigid-body acceleration by the planned forces, plus a proportional-derivative correction."""

    def __init__(
        self, params: WholeBodyParameters, model: RobotModel, inertia: np.ndarray
    ) -> None:
        self._mass = model.mass
        self._inverse_inertia = np.linalg.inv(inertia)
        self.tune(params)

    def tune(self, params: WholeBodyParameters) -> None:
        """Take other gains."""
        self._gains = np.array(
            (
                params.position_gains,
                params.velocity_gains,
                params.rotation_gains,
                params.rate_gains,
            )
        )

    def acceleration(
        self, state: RobotState, reference: BaseReference, forces: np.ndarray
    ) -> np.ndarray:
        """Linear then angular acceleration (6,), world axes; `forces` (4, 3) [N] by the feet."""
        R_wanted = matrix_from_rpy(*reference.rpy.tolist())
        return _acceleration(
            self._mass,
            self._inverse_inertia,
            state.R,
            state.contact.position - state.com,
            forces,
            self._gains,
            reference.position - state.position,
            reference.velocity - state.velocity,
            rotation_vector(R_wanted @ state.R.T),
            np.array((0.0, 0.0, reference.yaw_rate)),
            state.omega,
        )


@jit
def _acceleration(
    mass: float,
    inverse_inertia: np.ndarray,
    R: np.ndarray,
    arms: np.ndarray,
    forces: np.ndarray,
    gains: np.ndarray,
    position_error: np.ndarray,
    velocity_error: np.ndarray,
    rotation_error: np.ndarray,
    rate: np.ndarray,
    omega: np.ndarray,
) -> np.ndarray:
    """Arms (4, 3) and `omega` in base axes, everything else in world axes."""
    result = np.zeros(6)
    moment = np.zeros(3)
    for i in range(4):
        turn = cross3(arms[i], rotate_back(R, forces[i]))
        for k in range(3):
            result[k] += forces[i, k] / mass
            moment[k] += turn[k]
    result[2] -= 9.81
    angular = rotate(R, rotate(inverse_inertia, moment))
    spin = rotate(R, omega)
    for k in range(3):
        result[k] += gains[0, k] * position_error[k] + gains[1, k] * velocity_error[k]
        result[3 + k] = angular[k]
        result[3 + k] += gains[2, k] * rotation_error[k] + gains[3, k] * (rate[k] - spin[k])
    return result
