# SPDX-License-Identifier: Apache-2.0
"""Whole-body QP: joint torques whose base acceleration and foot forces are the ones asked for."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from wasd_core.robot_io import FULL_TORQUE_SHARE
from wasd_core.rotations import cross

from quadruped_sim.algebra import cross3
from quadruped_sim.algebra import invert3
from quadruped_sim.algebra import jit
from quadruped_sim.algebra import plain
from quadruped_sim.algebra import rotate
from quadruped_sim.algebra import rotate_back
from quadruped_sim.algebra import solve_in_place
from quadruped_sim.dynamics import Dynamics
from quadruped_sim.leg_kinematics import ContactPoints
from quadruped_sim.leg_kinematics import LegMotion
from quadruped_sim.locomotion.friction_qp import ForceBounds
from quadruped_sim.locomotion.friction_qp import FrictionPyramids
from quadruped_sim.locomotion.friction_qp import QpSolver
from quadruped_sim.parameters import MpcParameters
from quadruped_sim.parameters import WholeBodyParameters
from quadruped_sim.robot_model import JointLimits
from quadruped_sim.robot_model import RobotState


@dataclass(frozen=True)
class WholeBodyTask:
    """
    What the robot shall do now.

    `base_acceleration` (6,): linear [m/s^2] then angular [rad/s^2], world axes. `is_stance` (4,);
    `forces` (4, 3) [N] wanted on the feet, world axes; `foot_acceleration` (4, 3) [m/s^2] of the
    swing feet, world axes. `ground` (3, 3) turns ground axes into the world.
    """

    base_acceleration: np.ndarray
    is_stance: np.ndarray
    forces: np.ndarray
    foot_acceleration: np.ndarray
    ground: np.ndarray


@dataclass(frozen=True)
class WholeBodyResult:
    """`torque` (12,) [N m]; `forces` (4, 3) [N] on the feet, world axes; whether the QP solved."""

    torque: np.ndarray
    forces: np.ndarray
    is_solved: bool


class BodyRates(NamedTuple):
    """R (3, 3) base to world; velocity [m/s] and angular velocity [rad/s] (3,) in base axes."""

    R: np.ndarray
    velocity: np.ndarray
    omega: np.ndarray


class Feet(NamedTuple):
    """Which feet stand, (4,), and what those in the air shall accelerate at (4, 3), world axes."""

    is_stance: np.ndarray
    acceleration: np.ndarray


class LegTerms(NamedTuple):
    """
    What eliminates the joints' accelerations, leg by leg, base axes.

    Jacobian `J` (4, 3, 3) of the point that counts and its `inverse`; `Jb` (4, 3, 6) from the
    base's motion to that point's; its `wanted` acceleration (4, 3) less its drift. Of a standing
    leg the contact point counts, of one in the air the foot's centre.
    """

    J: np.ndarray
    inverse: np.ndarray
    Jb: np.ndarray
    wanted: np.ndarray


class WholeBody:
    """
    Eliminates joint accelerations by the 3 x 3 leg Jacobians, so the QP has only stance forces.

    Base acceleration a = T f + t; |T f + t - a_wanted|^2 + w |f - f_wanted|^2 is minimised inside
    the friction pyramids, as [Kim2019] relaxes both. Torques are linear in f, too: where motors
    cannot give them they become rows of the QP. docs/legs_math.md derives it, signs included.
    """

    def __init__(
        self, params: WholeBodyParameters, mpc: MpcParameters, limits: JointLimits | None = None
    ) -> None:
        self._limits = limits
        self.solver = QpSolver()
        self.tune(params, mpc)

    def tune(self, params: WholeBodyParameters, mpc: MpcParameters) -> None:
        """Take other weights; the limits of the forces are the MPC's."""
        self._weights = np.array(params.acceleration_weights)
        self._force_weight = params.force_weight
        self.pyramids = FrictionPyramids(mpc.friction, mpc.force_min, mpc.force_max)

    def solve(
        self, task: WholeBodyTask, state: RobotState, *, spares_motors: bool = True
    ) -> WholeBodyResult:
        """
        Torques for `task` of a robot in this state.

        When the QP fails the wanted forces are applied as they are. With `spares_motors` other
        forces are looked for where motors cannot give those.
        """
        base, R = state.base, state.base.R
        velocity = R.T @ base.velocity
        T, t, *terms = _reduce(
            plain(BodyRates(R, velocity, base.omega)),
            plain(state.motion),
            plain(state.contact),
            dynamics := plain(state.dynamics),
            plain(Feet(task.is_stance, task.foot_acceleration)),
            R.T @ task.ground,
        )
        goal = np.empty(6)
        goal[:3] = R.T @ task.base_acceleration[:3] - cross(base.omega, velocity)
        goal[3:] = R.T @ task.base_acceleration[3:]
        stands = np.flatnonzero(task.is_stance)
        legs = plain(LegTerms(*terms))

        def outcome(forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            in_world = np.zeros((4, 3))
            in_world[stands] = forces.reshape(-1, 3) @ task.ground.T
            return _torque(dynamics, legs, T @ forces + t, in_world @ R), in_world

        weighted = T.T * self._weights
        H = weighted @ T
        H.flat[:: 3 * len(stands) + 1] += self._force_weight
        wanted = (task.forces[stands] @ task.ground).ravel()
        g = weighted @ (t - goal) - self._force_weight * wanted
        bounds = self.pyramids.bounds(len(stands))
        forces, is_solved = self._forces(H, g, bounds, wanted)
        torque, in_world = outcome(forces)
        if spares_motors and self._limits is not None and len(stands):
            motors = motor_range(self._limits, state.joint_velocity)
            joints = np.flatnonzero(task.is_stance.repeat(3))
            if not _is_within(torque[joints], motors[:, joints]):
                free = outcome(np.zeros_like(forces))[0]
                slopes = np.array([outcome(unit)[0] - free for unit in np.eye(len(forces))])
                rows = slopes[:, joints].T, *(motors[:, joints] - free[joints])
                forces, is_solved = self._forces(H, g, bounds.with_soft(*rows), wanted)
                torque, in_world = outcome(forces)
        return WholeBodyResult(torque, in_world, is_solved)

    def _forces(
        self, H: np.ndarray, g: np.ndarray, bounds: ForceBounds, wanted: np.ndarray
    ) -> tuple[np.ndarray, bool]:
        """Stance forces in ground axes (3n,) [N]."""
        if len(g) == 0:
            return np.zeros(0), True
        forces = self.solver.solve(H, g, bounds)
        return (wanted, False) if forces is None else (forces, True)


def motor_range(limits: JointLimits, velocity: np.ndarray) -> np.ndarray:
    """
    Least and largest torque (2, 12) [N m] of motors that turn at `velocity` (12,) [rad/s].

    One that drives gives its full torque up to a share of its no-load speed, and none at it.
    """
    left = (1.0 - np.abs(velocity) / limits.velocity) / (1.0 - FULL_TORQUE_SHARE)
    driving = limits.effort * np.clip(left, 0.0, 1.0)
    least = np.where(velocity < 0.0, -driving, -limits.effort)
    return np.array((least, np.where(velocity > 0.0, driving, limits.effort)))


def _is_within(torque: np.ndarray, motors: np.ndarray) -> bool:
    return bool((torque >= motors[0]).all() and (torque <= motors[1]).all())


@jit
def _leg_terms(body: BodyRates, motion: LegMotion, contact: ContactPoints, feet: Feet) -> LegTerms:
    omega, centre = body.omega, motion.position
    J, inverse = np.empty((4, 3, 3)), np.empty((4, 3, 3))
    Jb, wanted = np.zeros((4, 3, 6)), np.empty((4, 3))
    for i in range(4):
        stands = feet.is_stance[i]
        arm = contact.position[i] if stands else centre[i]
        source = contact.jacobian[i] if stands else motion.jacobian[i]
        inverted = invert3(source)
        inner = cross3(omega, centre[i])
        for k in range(3):
            inner[k] += body.velocity[k] + 2.0 * motion.velocity[i, k]
        drift = cross3(omega, inner)
        goal = rotate_back(body.R, feet.acceleration[i])
        for k in range(3):
            wanted[i, k] = (0.0 if stands else goal[k]) - drift[k] - motion.bias[i, k]
            Jb[i, k, k] = 1.0
            for m in range(3):
                J[i, k, m] = source[k, m]
                inverse[i, k, m] = inverted[k, m]
        Jb[i, 0, 4], Jb[i, 0, 5] = arm[2], -arm[1]
        Jb[i, 1, 3], Jb[i, 1, 5] = -arm[2], arm[0]
        Jb[i, 2, 3], Jb[i, 2, 4] = arm[1], -arm[0]
    return LegTerms(J, inverse, Jb, wanted)


@jit
def _reduce(
    body: BodyRates,
    motion: LegMotion,
    contact: ContactPoints,
    dynamics: Dynamics,
    feet: Feet,
    ground: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """
    T (6, 3n) and t (6,), then the fields of `LegTerms`.

    T f + t is the base acceleration by stance forces f in ground axes.
    """
    dynamics, feet = Dynamics(*dynamics), Feet(*feet)
    is_stance = feet.is_stance
    legs = _leg_terms(BodyRates(*body), LegMotion(*motion), ContactPoints(*contact), feet)
    mass = dynamics.mass
    count = 0
    for i in range(4):
        count += 3 if is_stance[i] else 0
    A = np.empty((6, 6))
    G = np.zeros((6, count + 1))  # by the stance forces, then what is there without them
    for row in range(6):
        G[row, count] = -dynamics.bias[row]
        for k in range(6):
            A[row, k] = mass[row, k]
    column = 0
    for i in range(4):
        for row in range(6):
            for k in range(3):
                N = 0.0
                for m in range(3):
                    N += mass[row, 6 + 3 * i + m] * legs.inverse[i, m, k]
                G[row, count] -= N * legs.wanted[i, k]
                for m in range(6):
                    A[row, m] -= N * legs.Jb[i, k, m]
                if is_stance[i]:
                    for m in range(3):
                        G[row, column + k] += legs.Jb[i, m, row] * ground[m, k]
        column += 3 if is_stance[i] else 0
    solve_in_place(A, G)
    T, t = G[:, :count].copy(), G[:, count].copy()
    return T, t, legs.J, legs.inverse, legs.Jb, legs.wanted


@jit
def _torque(
    dynamics: Dynamics, legs: LegTerms, acceleration: np.ndarray, forces: np.ndarray
) -> np.ndarray:
    """Joint torques (12,) [N m] by the joint rows; `forces` (4, 3) are in base axes."""
    dynamics = Dynamics(*dynamics)
    legs = LegTerms(*legs)
    v = np.empty(18)
    torque = np.empty(12)
    for k in range(6):
        v[k] = acceleration[k]
    rest = np.empty(3)
    for i in range(4):
        for k in range(3):
            rest[k] = legs.wanted[i, k]
            for m in range(6):
                rest[k] -= legs.Jb[i, k, m] * acceleration[m]
        joints = rotate(legs.inverse[i], rest)
        for k in range(3):
            v[6 + 3 * i + k] = joints[k]
    for i in range(4):
        push = rotate_back(legs.J[i], forces[i])
        for k in range(3):
            row = 6 + 3 * i + k
            total = dynamics.bias[row] - push[k]
            for m in range(18):
                total += dynamics.mass[row, m] * v[m]
            torque[3 * i + k] = total
    return torque
