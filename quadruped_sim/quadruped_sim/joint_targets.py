# SPDX-License-Identifier: Apache-2.0
"""Joint positions, speeds and gains that the motors hold between two ticks of the trot."""

import numpy as np

from quadruped_sim.jit import jit
from quadruped_sim.leg_kinematics import solve_leg
from quadruped_sim.parameters import WholeBodyParameters
from quadruped_sim.records import LegCommand
from quadruped_sim.reference import BaseReference
from quadruped_sim.robot_model import RobotModel
from quadruped_sim.robot_state import RobotState
from quadruped_sim.small_matrix import cross3
from quadruped_sim.small_matrix import invert3
from quadruped_sim.small_matrix import rotate
from quadruped_sim.small_matrix import rotate_back
from quadruped_sim.swing_legs import SwingTargets


def joint_command(
    params: WholeBodyParameters,
    model: RobotModel,
    state: RobotState,
    reference: BaseReference,
    is_stance: np.ndarray,
    swing: SwingTargets,
    effort: np.ndarray,
) -> LegCommand:
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
        state.R,
        state.position,
        state.velocity,
        state.omega,
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
    return LegCommand(position, rates, effort, kp, kd)


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
