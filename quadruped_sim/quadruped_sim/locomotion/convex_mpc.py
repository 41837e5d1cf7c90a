# SPDX-License-Identifier: Apache-2.0
"""Convex model-predictive control of one rigid body by foot forces [DiCarlo2018], condensed."""

from dataclasses import dataclass

import numpy as np
from wasd_core.robot_io import GRAVITY

from quadruped_sim.locomotion.friction_qp import FrictionPyramids
from quadruped_sim.locomotion.friction_qp import QpSolver
from quadruped_sim.parameters import MpcParameters


@dataclass(frozen=True)
class MpcProblem:
    """
    Where the body is, where it shall be and which feet may push, in the base's yaw frame.

    `mass` [kg] is that of the body. `pose` (6,) is (roll, pitch, yaw, x, y, z) relative to the
    frame, `rates` (6,) angular then linear velocity. `pose_reference` and `rate_reference` are
    (N, 6), at the ends of the steps.
    `is_stance` (N, 4), `arms` (N, 4, 3) are the contact points relative to the centre of mass [m],
    `ground` (3, 3) turns ground axes into the yaw frame.
    """

    mass: float
    pose: np.ndarray
    rates: np.ndarray
    pose_reference: np.ndarray
    rate_reference: np.ndarray
    is_stance: np.ndarray
    arms: np.ndarray
    ground: np.ndarray


class ConvexMpc:
    """
    Foot forces that bring a rigid body along a reference over N steps.

    The body is a double integrator of u = B f + gravity; with the states eliminated the cost's
    Hessian is B'KB + R with a constant K. docs/legs_math.md derives it, signs included.
    """

    def __init__(self, params: MpcParameters, inertia: np.ndarray) -> None:
        self._inverse_inertia = np.linalg.inv(inertia)
        self.solver = QpSolver()
        self.tune(params)

    def tune(self, params: MpcParameters) -> None:
        """Take other parameters, another horizon among them."""
        self._params = params
        self.pyramids = FrictionPyramids(params.friction, params.force_min, params.force_max)
        n, dt = params.steps, params.step
        self.times = dt * np.arange(n)
        end = np.arange(1, n + 1)[:, None]
        start = np.arange(n)[None, :]
        rate_map = np.where(start < end, dt, 0.0)
        pose_map = np.where(start < end, dt * dt * (end - start - 0.5), 0.0)
        Qx, Qv = np.array(params.pose_weights), np.array(params.rate_weights)
        self._K = np.kron(pose_map.T @ pose_map, np.diag(Qx)) + np.kron(
            rate_map.T @ rate_map, np.diag(Qv)
        )
        self._pose_map, self._rate_map = pose_map, rate_map
        self._Qx, self._Qv = Qx, Qv
        gravity = np.zeros((n, 6))
        gravity[:, 5] = -GRAVITY
        self._pose_fall = pose_map @ gravity
        self._rate_fall = rate_map @ gravity
        self._ends = dt * end

    def solve(self, problem: MpcProblem) -> np.ndarray | None:
        """
        Forces on the feet during the first step, yaw frame, shape (4, 3) [N]; zero in swing.

        None when the QP fails: the caller keeps its last forces.
        """
        steps, legs = np.nonzero(problem.is_stance)
        count = len(steps)
        if count == 0:
            return np.zeros((4, 3))
        B = self._input_map(problem, steps, legs)
        g = B.T @ self._gradient(problem).ravel()
        H = B.T @ (self._K @ B)
        H.flat[:: 3 * count + 1] += self._params.force_weight
        forces = self.solver.solve(H, g, self.pyramids.bounds(count))
        if forces is None:
            return None
        first = np.zeros((4, 3))
        now = steps == 0
        first[legs[now]] = forces.reshape(count, 3)[now] @ problem.ground.T
        return first

    def _input_map(self, problem: MpcProblem, steps: np.ndarray, legs: np.ndarray) -> np.ndarray:
        """Matrix (6N, 3m) from stance forces in ground axes to body accelerations."""
        count = len(steps)
        arms = problem.arms[steps, legs]
        moment = np.zeros((count, 3, 3))
        moment[:, 0, 1], moment[:, 0, 2] = -arms[:, 2], arms[:, 1]
        moment[:, 1, 0], moment[:, 1, 2] = arms[:, 2], -arms[:, 0]
        moment[:, 2, 0], moment[:, 2, 1] = -arms[:, 1], arms[:, 0]
        block = np.empty((count, 6, 3))
        block[:, :3] = self._inverse_inertia @ moment @ problem.ground
        block[:, 3:] = problem.ground / problem.mass
        B = np.zeros((self._params.steps, 6, count, 3))
        B[steps, :, np.arange(count), :] = block
        return B.reshape(6 * self._params.steps, 3 * count)

    def _gradient(self, problem: MpcProblem) -> np.ndarray:
        """Cost gradient with respect to the body accelerations at zero force, shape (N, 6)."""
        rates = problem.rates + self._rate_fall
        pose = problem.pose + self._ends * problem.rates + self._pose_fall
        pose_error = (pose - problem.pose_reference) * self._Qx
        rate_error = (rates - problem.rate_reference) * self._Qv
        return np.asarray(self._pose_map.T @ pose_error + self._rate_map.T @ rate_error)
