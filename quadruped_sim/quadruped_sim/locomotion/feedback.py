# SPDX-License-Identifier: Apache-2.0
"""Feedback around the plan: what the base shall accelerate at, what the joints shall hold."""

import math

import numpy as np
from wasd_core.jit import jit
from wasd_core.robot_io import GRAVITY, JointCommand

from quadruped_sim.algebra import cross3, invert3, plain, put, rotate, rotate_back
from quadruped_sim.dynamics import drag
from quadruped_sim.leg_kinematics import LegGeometry, solve_leg
from quadruped_sim.locomotion.reference import BaseReference
from quadruped_sim.locomotion.swing import SwingTargets
from quadruped_sim.robot_model import RobotModel
from quadruped_sim.robot_state import RobotState
from quadruped_sim.tuning import WholeBodyParameters


def gains_of(params: WholeBodyParameters) -> np.ndarray:
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


@jit
def rotation_error(rpy: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Axis times angle (3,) [rad], world axes, of the turn from `R` to `rpy` (3,)."""
    cr, sr, cp, sp = math.cos(rpy[0]), math.sin(rpy[0]), math.cos(rpy[1]), math.sin(rpy[1])
    cy, sy = math.cos(rpy[2]), math.sin(rpy[2])
    wanted = np.empty((3, 3))
    a, b = sp * sr, sp * cr
    wanted[0, 0], wanted[0, 1], wanted[0, 2] = cy * cp, cy * a - sy * cr, cy * b + sy * sr
    wanted[1, 0], wanted[1, 1], wanted[1, 2] = sy * cp, sy * a + cy * cr, sy * b - cy * sr
    wanted[2, 0], wanted[2, 1], wanted[2, 2] = -sp, cp * sr, cp * cr
    turn = np.zeros((3, 3))  # wanted R'
    for i in range(3):
        for j in range(3):
            for k in range(3):
                turn[i, j] += wanted[i, k] * R[j, k]
    error = np.empty(3)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        error[k] = 0.5 * (turn[j, i] - turn[i, j])
    sine = math.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2)
    cosine = 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0)
    if sine >= 1e-9:
        for k in range(3):
            error[k] *= math.atan2(sine, cosine) / sine
    return error


def base_acceleration(
    rules: np.ndarray, robot: RobotState, position: np.ndarray, rpy: np.ndarray
) -> np.ndarray:
    """
    Acceleration (6,) that brings the base to rest at a pose: linear then angular, world axes.

    `position` (3,) [m] and `rpy` (3,) [rad] are in the world. Each axis is limited. `rules` see
    `flat_rules`.
    """
    result = np.empty(6)
    _hold(robot.flat, rules, (position, rpy), robot.base.R @ robot.base.omega, result)
    return result


@jit
def _hold(
    robot: np.ndarray,
    rules: np.ndarray,
    pose: tuple[np.ndarray, np.ndarray],
    spin: np.ndarray,
    result: np.ndarray,
) -> None:
    """Write `base_acceleration` of a base that turns at `spin` (3,) [rad/s], world axes."""
    base, own, (position, rpy) = robot[0].base, rules[0].balance, pose
    turn = rotation_error(rpy, base.R)
    for k in range(3):
        error = position[k] - base.position[k]
        linear = own.position_gains[k] * error - own.velocity_gains[k] * base.velocity[k]
        angular = own.rotation_gains[k] * turn[k] - own.rate_gains[k] * spin[k]
        result[k] = min(max(linear, -own.acceleration_max), own.acceleration_max)
        result[3 + k] = min(max(angular, -own.rotation_max), own.rotation_max)


def standing_forces(weight: float, is_stance: np.ndarray) -> np.ndarray:
    """Weight [N] shared evenly by the standing feet, shape (4, 3), world axes."""
    forces = np.zeros((4, 3))
    forces[:, 2] = weight / max(is_stance.tolist().count(True), 1) * is_stance
    return forces


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
        result = np.zeros(6)
        law = self._inverse_inertia, self._gains
        _accelerate(state.flat, plain(reference), forces, law, result)
        return result


@jit
def _accelerate(
    robot: np.ndarray,
    reference: BaseReference,
    forces: np.ndarray,
    law: tuple[np.ndarray, np.ndarray],
    result: np.ndarray,
) -> None:
    """Write `BaseTracking.acceleration`; `law` are the inverse of the inertia, and the gains."""
    base, contact, dynamics = robot[0].base, robot[0].contact, robot[0].dynamics
    reference = BaseReference(*reference)
    inverse_inertia, gains = law
    R = base.R
    moment, arm = np.zeros(3), np.empty(3)
    for i in range(4):
        for k in range(3):
            arm[k] = contact.position[i, k] - dynamics.com[k]
        turn = cross3(arm, rotate_back(R, forces[i]))
        for k in range(3):
            result[k] += forces[i, k] / dynamics.mass[0, 0]
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
    tilt = rotation_error(reference.rpy, R)
    correction = pd_law(gains, position_error, velocity_error, tilt, rate_error)
    for k in range(6):
        result[k] += correction[k]


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

    Motors also make up for the joints' losses at the wanted speeds: at measured speeds noise would
    give the sign at rest, and would undo the damping.

    A standing leg is only damped, about the joint speeds at which the base moves as wanted; a leg
    in the air also has stiffness about its target.
    """
    parts = np.empty((5, 12))
    gains = params.swing_kp, params.swing_kd, params.stance_kd
    targets = plain(reference), plain(swing), effort
    robot = model.rigid[0], state.flat
    _find_joint_targets(plain(model.geometry), robot, targets, gains, parts)
    return JointCommand(*parts)


@jit
def _find_joint_targets(
    leg: LegGeometry,
    rigid_robot: tuple[np.ndarray, np.ndarray],
    targets: tuple[BaseReference, SwingTargets, np.ndarray],
    gains: tuple[float, float, float],
    parts: np.ndarray,
) -> None:
    """
    Write a `JointCommand`, (5, 12), with efforts that add what the joints lose at its rates.

    `rigid_robot` are flat `Bodies` and a flat `RobotState`.
    """
    bodies, robot = rigid_robot[0][0], rigid_robot[1]
    base, motion = robot[0].base, robot[0].motion
    reference, swing = BaseReference(*targets[0]), SwingTargets(*targets[1])
    effort = targets[2]
    swing_kp, swing_kd, stance_kd = gains
    R = base.R
    position, rates = parts[0], parts[1]
    put(position, robot[0].joint_position)
    turn, relative, inverse = np.empty(3), np.empty(3), np.empty((3, 3))
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
        invert3(motion.jacobian[i], inverse)
        joint_rates = rotate(inverse, relative)
        for k in range(3):
            rates[3 * i + k] = joint_rates[k]
            loss = drag(bodies, 3 * i + k, joint_rates[k])
            parts[2, 3 * i + k] = effort[3 * i + k] + loss
            parts[3, 3 * i + k] = 0.0 if swing.is_stance[i] else swing_kp
            parts[4, 3 * i + k] = stance_kd if swing.is_stance[i] else swing_kd
