# SPDX-License-Identifier: Apache-2.0
"""Feedback around the plan: what the base shall accelerate at, what the joints shall hold."""

from typing import NamedTuple

import numpy as np
from wasd_core.robot_io import GRAVITY
from wasd_core.robot_io import JointCommand
from wasd_core.rotations import rotation_vector
from wasd_core.rotations import rpy_matrix

from quadruped_sim.algebra import cross3
from quadruped_sim.algebra import invert3
from quadruped_sim.algebra import jit
from quadruped_sim.algebra import plain
from quadruped_sim.algebra import rotate
from quadruped_sim.algebra import rotate_back
from quadruped_sim.leg_kinematics import LegGeometry
from quadruped_sim.leg_kinematics import LegMotion
from quadruped_sim.leg_kinematics import solve_leg
from quadruped_sim.locomotion.reference import BaseReference
from quadruped_sim.locomotion.swing import SwingTargets
from quadruped_sim.parameters import BalanceParameters
from quadruped_sim.parameters import WholeBodyParameters
from quadruped_sim.robot_model import RobotModel
from quadruped_sim.robot_state import BaseMotion
from quadruped_sim.robot_state import RobotState


def gains_of(params: BalanceParameters | WholeBodyParameters) -> np.ndarray:
    """Gains (4, 3) of the law: rows are position, velocity, rotation and rate."""
    return np.array(
        (params.position_gains, params.velocity_gains, params.rotation_gains, params.rate_gains)
    )


@jit
def pd_law(
    gains: np.ndarray,
    position_error: np.ndarray,
    velocity_error: np.ndarray,
    rotation_error: np.ndarray,
    rate_error: np.ndarray,
) -> np.ndarray:
    """Acceleration (6,) against errors, each (3,): linear then angular, all in world axes."""
    result = np.empty(6)
    for k in range(3):
        result[k] = gains[0, k] * position_error[k] + gains[1, k] * velocity_error[k]
        result[3 + k] = gains[2, k] * rotation_error[k] + gains[3, k] * rate_error[k]
    return result


def rotation_error(rpy: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Axis times angle (3,) [rad], world axes, by which `R` is to turn to have `rpy` (3,)."""
    return rotation_vector(rpy_matrix(*rpy.tolist()) @ R.T)


def base_acceleration(
    params: BalanceParameters, base: BaseMotion, position: np.ndarray, rpy: np.ndarray
) -> np.ndarray:
    """
    Acceleration (6,) that brings the base to rest at a pose: linear then angular, world axes.

    `position` (3,) [m] and `rpy` (3,) [rad] are in the world. Each axis is limited.
    """
    wanted = pd_law(
        gains_of(params),
        position - base.position,
        -base.velocity,
        rotation_error(rpy, base.R),
        -(base.R @ base.omega),
    )
    most = np.repeat((params.acceleration_max, params.rotation_max), 3)
    return np.asarray(np.clip(wanted, -most, most))


def standing_forces(weight: float, is_stance: np.ndarray) -> np.ndarray:
    """Weight [N] shared evenly by the standing feet, shape (4, 3), world axes."""
    forces = np.zeros((4, 3))
    forces[is_stance, 2] = weight / max(int(is_stance.sum()), 1)
    return forces


class Push(NamedTuple):
    """
    Forces on the feet (4, 3) [N], world axes, and their arms about the CoM, base axes [m].

    `mass` [kg] is what they move.
    """

    forces: np.ndarray
    arms: np.ndarray
    mass: float


class BaseTracking:
    """Rigid-body acceleration by the planned forces, plus the proportional-derivative law."""

    def __init__(self, params: WholeBodyParameters, inertia: np.ndarray) -> None:
        self._inverse_inertia = np.linalg.inv(inertia)
        self.tune(params)

    def tune(self, params: WholeBodyParameters) -> None:
        """Take other gains."""
        self._gains = gains_of(params)

    def acceleration(
        self, state: RobotState, reference: BaseReference, forces: np.ndarray
    ) -> np.ndarray:
        """Linear then angular acceleration (6,), world axes; `forces` (4, 3) [N] by the feet."""
        base = state.base
        push = Push(forces, state.contact.position - state.com, state.mass)
        error = rotation_error(reference.rpy, base.R)
        return _acceleration(
            self._inverse_inertia,
            self._gains,
            plain(base),
            plain(reference),
            error,
            plain(push),
        )


@jit
def _acceleration(
    inverse_inertia: np.ndarray,
    gains: np.ndarray,
    base: BaseMotion,
    reference: BaseReference,
    rotation_error: np.ndarray,
    push: Push,
) -> np.ndarray:
    base = BaseMotion(*base)
    reference = BaseReference(*reference)
    push = Push(*push)
    R = base.R
    result = np.zeros(6)
    moment = np.zeros(3)
    for i in range(4):
        turn = cross3(push.arms[i], rotate_back(R, push.forces[i]))
        for k in range(3):
            result[k] += push.forces[i, k] / push.mass
            moment[k] += turn[k]
    result[2] -= GRAVITY
    angular = rotate(R, rotate(inverse_inertia, moment))
    spin = rotate(R, base.omega)
    position_error, velocity_error, rate_error = np.empty(3), np.empty(3), np.empty(3)
    for k in range(3):
        result[3 + k] = angular[k]
        position_error[k] = reference.position[k] - base.position[k]
        velocity_error[k] = reference.velocity[k] - base.velocity[k]
        rate_error[k] = (reference.yaw_rate if k == 2 else 0.0) - spin[k]
    correction = pd_law(gains, position_error, velocity_error, rotation_error, rate_error)
    for k in range(6):
        result[k] += correction[k]
    return result


def joint_command(
    params: WholeBodyParameters,
    model: RobotModel,
    state: RobotState,
    reference: BaseReference,
    swing: SwingTargets,
    effort: np.ndarray,
) -> JointCommand:
    """
    Torques `effort` (12,) [N m] with motor-side gains around what the legs should be doing.

    A standing leg is only damped, about the joint speeds at which the base moves as wanted; a leg
    in the air also has stiffness about its target.
    """
    position, rates = _joint_targets(
        plain(model.geometry),
        state.joint_position,
        plain(state.motion),
        plain(state.base),
        plain(reference),
        plain(swing),
    )
    stands = swing.is_stance.repeat(3)
    kp = np.where(stands, 0.0, params.swing_kp)
    kd = np.where(stands, params.stance_kd, params.swing_kd)
    return JointCommand(position, rates, effort, kp, kd)


@jit
def _joint_targets(
    leg: LegGeometry,
    angles: np.ndarray,
    motion: LegMotion,
    base: BaseMotion,
    reference: BaseReference,
    swing: SwingTargets,
) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles and rates, both (12,)."""
    motion = LegMotion(*motion)
    base = BaseMotion(*base)
    reference = BaseReference(*reference)
    swing = SwingTargets(*swing)
    R = base.R
    position, rates = angles.copy(), np.empty(12)
    turn, relative = np.empty(3), np.empty(3)
    for i in range(4):
        if swing.is_stance[i]:
            for k in range(3):
                turn[k] = R[2, k] * reference.yaw_rate  # the yaw axis in base axes
                relative[k] = -reference.velocity[k]
        else:
            for k in range(3):
                turn[k] = swing.position[i, k] - base.position[k]
            solved = solve_leg(leg, i, rotate_back(R, turn))[0]
            for k in range(3):
                position[3 * i + k] = solved[k]
                turn[k] = base.omega[k]
                relative[k] = swing.velocity[i, k] - base.velocity[k]
        seen = rotate_back(R, relative)
        swept = cross3(turn, motion.position[i])
        for k in range(3):
            relative[k] = seen[k] - swept[k]
        joint_rates = rotate(invert3(motion.jacobian[i]), relative)
        for k in range(3):
            rates[3 * i + k] = joint_rates[k]
    return position, rates
