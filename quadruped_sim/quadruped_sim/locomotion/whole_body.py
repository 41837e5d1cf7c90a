# SPDX-License-Identifier: Apache-2.0
"""Whole-body QP: joint torques whose base acceleration and foot forces are the ones asked for."""

from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit
from wasd_core.robot_io import FULL_TORQUE_SHARE

from quadruped_sim.algebra import (
    cross3,
    flatten,
    invert3,
    plain,
    put,
    rotate,
    rotate_back,
    solve_in_place,
)
from quadruped_sim.locomotion.convex_mpc import ForceBounds, FrictionPyramids, QpSolver
from quadruped_sim.robot_model import JointLimits
from quadruped_sim.robot_state import RobotState
from quadruped_sim.tuning import MpcParameters, WholeBodyParameters


class WholeBodyTask(NamedTuple):
    """
    The present task of the robot.

    `base_acceleration` (6,): linear [m/s^2] then angular [rad/s^2], world axes. `is_stance` (4,);
    `forces` (4, 3) [N] wanted on the feet, world axes; `foot_acceleration` (4, 3) [m/s^2] of the
    swing feet, world axes. `ground` (3, 3) turns ground axes into the world.
    """

    base_acceleration: np.ndarray
    is_stance: np.ndarray
    forces: np.ndarray
    foot_acceleration: np.ndarray
    ground: np.ndarray


class WholeBodyResult(NamedTuple):
    """`torque` (12,) [N m]; `forces` (4, 3) [N] on the feet, world axes; whether the QP solved."""

    torque: np.ndarray
    forces: np.ndarray
    is_solved: bool


class LegTerms(NamedTuple):
    """
    What eliminates the joints' accelerations, leg by leg, base axes, and what is left.

    Jacobian `J` (4, 3, 3) of the point that counts and its `inverse`; `Jb` (4, 3, 6) from the
    base's motion to that point's; its `wanted` acceleration (4, 3) less its drift. Of a standing
    leg the contact point counts, of one in the air the foot's centre.

    The base accelerates at T f + t by stance forces f, ground axes; `T` is (6, 3n), `t` (6,).
    """

    J: np.ndarray
    inverse: np.ndarray
    Jb: np.ndarray
    wanted: np.ndarray
    T: np.ndarray
    t: np.ndarray


_SHAPES = (4, 3, 3), (4, 3, 3), (4, 3, 6), (4, 3), (6, 12), 6


class Costs(NamedTuple):
    """Hessian (3n, 3n) and gradient (3n,) of a QP, and the forces wanted (3n,), ground axes."""

    H: np.ndarray
    g: np.ndarray
    wanted: np.ndarray


class Weights(NamedTuple):
    """Of the base's acceleration (6,), base axes, and of forces, each axis the same."""

    acceleration: np.ndarray
    force: float


class WholeBody:
    """
    Eliminates joint accelerations by the 3 x 3 leg Jacobians, so the QP has only stance forces.

    Base acceleration a = T f + t; |T f + t - a_wanted|^2 + w |f - f_wanted|^2 is minimised inside
    the friction pyramids, as [Kim2019] relaxes both. Torques are linear in f, too: where motors
    cannot give them they become rows of the QP. docs/legs_math.md derives it, signs included.
    """

    def __init__(
        self, params: WholeBodyParameters, mpc: MpcParameters, limits: JointLimits
    ) -> None:
        self._limits = limits
        self._legs = flatten(LegTerms(*(np.zeros(shape) for shape in _SHAPES)))
        # One of each number of standing feet: its arrays are the solver's, as long as they are.
        self._costs = [Costs(np.zeros((n, n)), np.zeros(n), np.zeros(n)) for n in range(0, 15, 3)]
        self.solver = QpSolver()
        self.tune(params, mpc)

    def tune(self, params: WholeBodyParameters, mpc: MpcParameters) -> None:
        """Take other weights; the limits of the forces are the MPC's."""
        self._weights = flatten(
            Weights(np.array(params.acceleration_weights), params.force_weight)
        )
        self.pyramids = FrictionPyramids(mpc.friction, mpc.force_min, mpc.force_max)

    def solve(
        self, task: WholeBodyTask, state: RobotState, *, spares_motors: bool = True
    ) -> WholeBodyResult:
        """
        Torques for `task` of a robot in this state.

        When the QP fails the wanted forces are applied as they are. With `spares_motors` other
        forces are looked for where motors cannot give those.
        """
        asked = plain(task)
        costs = self._costs[task.is_stance.tolist().count(True)]
        _pose(state.flat, asked, self._legs, self._weights, plain(costs))
        bounds = self.pyramids.bounds(len(costs.g) // 3)
        forces, is_solved = self._forces(costs, bounds)

        limits = self._limits

        def outcome(forces: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
            out, motors = (np.empty(12), np.zeros((4, 3))), (limits.effort, limits.velocity)
            return *out, _answer(state.flat, asked, self._legs, forces, out, motors)

        torque, in_world, overtaxes = outcome(forces)
        if spares_motors and overtaxes:
            joints = np.flatnonzero(task.is_stance.repeat(3))
            motors = motor_range(limits.effort, limits.velocity, state.joint_velocity)[:, joints]
            free = outcome(np.zeros_like(forces))[0]
            slopes = np.array([outcome(unit)[0] - free for unit in np.eye(len(forces))])
            rows = slopes[:, joints].T, *(motors - free[joints])
            forces, is_solved = self._forces(costs, bounds.with_soft(*rows))
            torque, in_world, _ = outcome(forces)
        return WholeBodyResult(torque, in_world, is_solved)

    def _forces(self, costs: Costs, bounds: ForceBounds) -> tuple[np.ndarray, bool]:
        """Stance forces in ground axes (3n,) [N]."""
        if len(costs.g) == 0:
            return costs.wanted, True
        forces = self.solver.solve(costs.H, costs.g, bounds)
        return (costs.wanted, False) if forces is None else (forces, True)


@jit
def motor_range(effort: np.ndarray, no_load: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """
    Least and largest torque (2, 12) [N m] of motors that turn at `velocity` (12,) [rad/s].

    One that drives gives its full `effort` [N m] up to a share of its no-load speed [rad/s], and
    none at it.
    """
    motors = np.empty((2, len(velocity)))
    for i in range(len(velocity)):
        left = (1.0 - abs(velocity[i]) / no_load[i]) / (1.0 - FULL_TORQUE_SHARE)
        driving = effort[i] * min(max(left, 0.0), 1.0)
        motors[0, i] = -driving if velocity[i] < 0.0 else -effort[i]
        motors[1, i] = driving if velocity[i] > 0.0 else effort[i]
    return motors


@jit
def _overtaxes(
    effort: np.ndarray,
    no_load: np.ndarray,
    velocity: np.ndarray,
    torque: np.ndarray,
    is_stance: np.ndarray,
) -> bool:
    """Whether a joint of a standing leg is to give a torque that its motor has not."""
    motors = motor_range(effort, no_load, velocity)
    for i in range(12):
        if is_stance[i // 3] and not motors[0, i] <= torque[i] <= motors[1, i]:
            return True
    return False


@jit
def _find_legs(state: RobotState, task: WholeBodyTask, legs: LegTerms) -> None:
    """Write all of `LegTerms` but T and t."""
    base, motion, contact = state.base, state.motion, state.contact
    omega, centre = base.omega, motion.position
    velocity, inner = rotate_back(base.R, base.velocity), np.empty(3)
    for i in range(4):
        stands = task.is_stance[i]
        arm = contact.position[i] if stands else centre[i]
        source = contact.jacobian[i] if stands else motion.jacobian[i]
        invert3(source, legs.inverse[i])
        turn = cross3(omega, centre[i])
        for k in range(3):
            inner[k] = turn[k] + (velocity[k] + 2.0 * motion.velocity[i, k])
        drift, Jb = cross3(omega, inner), legs.Jb
        goal = rotate_back(base.R, task.foot_acceleration[i])
        for k in range(3):
            legs.wanted[i, k] = (0.0 if stands else goal[k]) - drift[k] - motion.bias[i, k]
            for m in range(3):
                legs.J[i, k, m] = source[k, m]
                Jb[i, k, m] = 1.0 if k == m else 0.0
        Jb[i, 0, 4], Jb[i, 0, 5] = arm[2], -arm[1]
        Jb[i, 1, 3], Jb[i, 1, 5] = -arm[2], arm[0]
        Jb[i, 2, 3], Jb[i, 2, 4] = arm[1], -arm[0]


@jit
def _pose(
    robot: np.ndarray,
    task: WholeBodyTask,
    flat_legs: np.ndarray,
    flat_weights: np.ndarray,
    costs: Costs,
) -> None:
    """Write `LegTerms`, flat, and the costs of the QP."""
    named = WholeBodyTask(*task)
    _reduce(robot, named, flat_legs)
    _weigh(robot, named, flat_legs, flat_weights, Costs(*costs))


@jit
def _answer(
    robot: np.ndarray,
    task: WholeBodyTask,
    flat_legs: np.ndarray,
    forces: np.ndarray,
    out: tuple[np.ndarray, np.ndarray],
    motors: tuple[np.ndarray, np.ndarray],
) -> bool:
    """
    Write torques and the forces in world axes: see `_find_torque`.

    Return whether they overtax `motors` of efforts and no-load speeds, (12,).
    """
    named, (torque, in_world) = WholeBodyTask(*task), out
    _find_torque(robot, named, flat_legs, forces, torque, in_world)
    return _overtaxes(motors[0], motors[1], robot[0].joint_velocity, torque, named.is_stance)


@jit
def _reduce(robot: np.ndarray, task: WholeBodyTask, flat_legs: np.ndarray) -> None:
    """Eliminate the joints' accelerations: write `LegTerms`, flat."""
    state, legs = robot[0], flat_legs[0]
    base, dynamics, is_stance = state.base, state.dynamics, task.is_stance
    _find_legs(state, task, legs)
    ground = np.zeros((3, 3))  # from ground axes to the base's
    for row in range(3):
        for column in range(3):
            for k in range(3):
                ground[row, column] += base.R[k, row] * task.ground[k, column]
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
    for row in range(6):
        legs.t[row] = G[row, count]
        for column in range(count):
            legs.T[row, column] = G[row, column]


@jit
def _weigh(
    robot: np.ndarray,
    task: WholeBodyTask,
    flat_legs: np.ndarray,
    flat_weights: np.ndarray,
    costs: Costs,
) -> None:
    """Write the costs of the QP."""
    base, legs, weights = robot[0].base, flat_legs[0], flat_weights[0]
    T, R = legs.T, base.R
    linear = rotate_back(R, task.base_acceleration[:3])
    angular = rotate_back(R, task.base_acceleration[3:])
    swept = cross3(base.omega, rotate_back(R, base.velocity))
    short = np.empty(6)  # of the wanted acceleration without forces
    for k in range(3):
        short[k] = weights.acceleration[k] * (legs.t[k] - linear[k] + swept[k])
        short[3 + k] = weights.acceleration[3 + k] * (legs.t[3 + k] - angular[k])
    H, g, wanted = costs.H, costs.g, costs.wanted
    row = 0
    for i in range(4):
        if task.is_stance[i]:
            force = rotate_back(task.ground, task.forces[i])
            for k in range(3):
                wanted[row + k] = force[k]
            row += 3
    for i in range(len(g)):
        for j in range(len(g)):
            H[i, j] = weights.force if i == j else 0.0
            for k in range(6):
                H[i, j] += T[k, i] * weights.acceleration[k] * T[k, j]
        g[i] = -weights.force * wanted[i]
        for k in range(6):
            g[i] += T[k, i] * short[k]


@jit
def _find_torque(
    robot: np.ndarray,
    task: WholeBodyTask,
    flat_legs: np.ndarray,
    forces: np.ndarray,
    torque: np.ndarray,
    in_world: np.ndarray,
) -> None:
    """Write joint torques (12,) [N m] by the joint rows, and the forces (4, 3) in world axes."""
    legs, base, dynamics = flat_legs[0], robot[0].base, robot[0].dynamics
    v = np.empty(18)
    for k in range(6):
        v[k] = legs.t[k]
        for m in range(len(forces)):
            v[k] += legs.T[k, m] * forces[m]
    rest = np.empty(3)
    stands = 0
    for i in range(4):
        if task.is_stance[i]:
            put(in_world[i], rotate(task.ground, forces[stands : stands + 3]))
            stands += 3
        for k in range(3):
            rest[k] = legs.wanted[i, k]
            for m in range(6):
                rest[k] -= legs.Jb[i, k, m] * v[m]
        joints = rotate(legs.inverse[i], rest)
        for k in range(3):
            v[6 + 3 * i + k] = joints[k]
    for i in range(4):
        push = rotate_back(legs.J[i], rotate_back(base.R, in_world[i]))
        for k in range(3):
            row = 6 + 3 * i + k
            total = dynamics.bias[row] - push[k]
            for m in range(18):
                total += dynamics.mass[row, m] * v[m]
            torque[3 * i + k] = total
