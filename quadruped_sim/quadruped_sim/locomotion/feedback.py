# SPDX-License-Identifier: Apache-2.0
"""Feedback around the plan: what the base shall accelerate at, what the joints shall hold."""

import numpy as np
from wasd_core.robot_io import GRAVITY
from wasd_core.robot_io import JointCommand

from quadruped_sim.algebra import cross3
from quadruped_sim.algebra import invert3
from quadruped_sim.algebra import jit
from quadruped_sim.algebra import matrix_from_rpy
from quadruped_sim.algebra import rotate
from quadruped_sim.algebra import rotate_back
from quadruped_sim.algebra import rotation_vector
from quadruped_sim.estimation.robot_state import RobotState
from quadruped_sim.leg_kinematics import solve_leg
from quadruped_sim.locomotion.reference import BaseReference
from quadruped_sim.locomotion.swing import SwingTargets
from quadruped_sim.parameters import BalanceParameters
from quadruped_sim.parameters import WholeBodyParameters
from quadruped_sim.robot_model import RobotModel


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
    linear = np.array(params.position_gains) * (position - state.base.position)
    linear -= np.array(params.velocity_gains) * state.base.velocity
    R_wanted = matrix_from_rpy(*rpy.tolist())
    error = rotation_vector(R_wanted @ state.base.R.T)
    angular = np.array(params.rotation_gains) * error
    angular -= np.array(params.rate_gains) * (state.base.R @ state.base.omega)
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
            state.base.R,
            state.contact.position - state.com,
            forces,
            self._gains,
            reference.position - state.base.position,
            reference.velocity - state.base.velocity,
            rotation_vector(R_wanted @ state.base.R.T),
            np.array((0.0, 0.0, reference.yaw_rate)),
            state.base.omega,
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
    result[2] -= GRAVITY
    angular = rotate(R, rotate(inverse_inertia, moment))
    spin = rotate(R, omega)
    for k in range(3):
        result[k] += gains[0, k] * position_error[k] + gains[1, k] * velocity_error[k]
        result[3 + k] = angular[k]
        result[3 + k] += gains[2, k] * rotation_error[k] + gains[3, k] * (rate[k] - spin[k])
    return result


def joint_command(
    params: WholeBodyParameters,
    model: RobotModel,
    state: RobotState,
    reference: BaseReference,
    is_stance: np.ndarray,
    swing: SwingTargets,
    effort: np.ndarray,
) -> JointCommand:
    """
    Torques `effort` (12,) [N m] with motor-side gains around what the legs should be doing.

    A standing leg is only damped, about the joint speeds at which the base moves as wanted; a leg
    in the air also has stiffness about its target.
    """
    leg = model.geometry
    position, rates = _joint_targets(
        state.joint_position,
        state.motion.jacobian,
        state.motion.position,
        state.base.R,
        state.base.position,
        state.base.velocity,
        state.base.omega,
        reference.velocity,
        reference.yaw_rate,
        is_stance,
        swing.position,
        swing.velocity,
        leg.hip,
        leg.offset,
        leg.drop,
        leg.thigh,
        leg.calf,
        leg.bend,
    )
    stands = is_stance.repeat(3)
    kp = np.where(stands, 0.0, params.swing_kp)
    kd = np.where(stands, params.stance_kd, params.swing_kd)
    return JointCommand(position, rates, effort, kp, kd)


@jit
def _joint_targets(
    angles: np.ndarray,
    jacobian: np.ndarray,
    foot: np.ndarray,
    R: np.ndarray,
    base_position: np.ndarray,
    base_velocity: np.ndarray,
    omega: np.ndarray,
    wanted_velocity: np.ndarray,
    wanted_yaw_rate: float,
    is_stance: np.ndarray,
    swing_position: np.ndarray,
    swing_velocity: np.ndarray,
    hip: np.ndarray,
    offset: np.ndarray,
    drop: np.ndarray,
    thigh: np.ndarray,
    calf: np.ndarray,
    bend: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles and rates, both (12,); swing targets and base motion in world axes."""
    position, rates = angles.copy(), np.empty(12)
    turn, relative = np.empty(3), np.empty(3)
    for i in range(4):
        for k in range(3):
            if is_stance[i]:
                turn[k] = R[2, k] * wanted_yaw_rate  # the yaw axis in base axes
                relative[k] = -wanted_velocity[k]
            else:
                turn[k] = omega[k]
                relative[k] = swing_velocity[i, k] - base_velocity[k]
        if not is_stance[i]:
            for k in range(3):
                turn[k] = swing_position[i, k] - base_position[k]
            target = rotate_back(R, turn)
            for k in range(3):
                target[k] -= hip[i, k]
                turn[k] = omega[k]
            solved = solve_leg(target, offset[i], drop[i], thigh[i], calf[i], bend[i])[0]
            for k in range(3):
                position[3 * i + k] = solved[k]
        seen = rotate_back(R, relative)
        swept = cross3(turn, foot[i])
        for k in range(3):
            relative[k] = seen[k] - swept[k]
        joint_rates = rotate(invert3(jacobian[i]), relative)
        for k in range(3):
            rates[3 * i + k] = joint_rates[k]
    return position, rates
