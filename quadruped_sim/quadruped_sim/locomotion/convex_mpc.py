# SPDX-License-Identifier: Apache-2.0
"""Convex model-predictive control [DiCarlo2018], condensed; quadratic programs over forces."""

from typing import NamedTuple

import daqp
import numpy as np
from wasd_core.jit import jit
from wasd_core.robot_io import GRAVITY

from quadruped_sim.algebra import cross3, plain, rotate
from quadruped_sim.tuning import MpcParameters


class ForceBounds(NamedTuple):
    """
    Constraints on n forces stacked as (3n,): `lower` <= (x, A x) <= `upper`.

    The last `soft` of them are kept as well as the others allow.
    """

    A: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    soft: int = 0

    def with_soft(self, A: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> 'ForceBounds':
        """Return these and more rows, which are soft."""
        return ForceBounds(
            np.vstack((self.A, A)),
            np.concatenate((self.lower, lower)),
            np.concatenate((self.upper, upper)),
            len(A),
        )


_LARGE = 1e30
_SOFT = 8  # daqp's mark of a constraint that may be violated if there is no other way


class FrictionPyramids:
    """
    Bounds of n feet: force_min <= fz <= force_max and |fx|, |fy| <= friction fz.

    Keeps what it built per n: the horizon of a gait repeats a few sizes.
    """

    def __init__(self, friction: float, force_min: float, force_max: float) -> None:
        self._friction = self._asked = friction
        self._force_min = force_min
        self._force_max = force_max
        self._cache: dict[int, ForceBounds] = {}

    @property
    def friction(self) -> float:
        """Coefficient in use, in steps of a hundredth."""
        return self._friction

    @friction.setter
    def friction(self, friction: float) -> None:
        if friction == self._asked:
            return
        self._asked, rounded = friction, round(friction, 2)
        if rounded != self._friction:
            self._friction = rounded
            self._cache.clear()

    def bounds(self, count: int) -> ForceBounds:
        """Constraints on `count` feet, forces in axes whose z is the ground's normal."""
        if count not in self._cache:
            self._cache[count] = self._build(count)
        return self._cache[count]

    def _build(self, count: int) -> ForceBounds:
        mu, side = self._friction, self._friction * self._force_max
        one = np.array(((1.0, 0.0, -mu), (-1.0, 0.0, -mu), (0.0, 1.0, -mu), (0.0, -1.0, -mu)))
        A = np.kron(np.eye(count), one)
        lower = np.concatenate(
            (np.tile((-side, -side, self._force_min), count), np.full(4 * count, -_LARGE))
        )
        upper = np.concatenate(
            (np.tile((side, side, self._force_max), count), np.zeros(4 * count))
        )
        return ForceBounds(A, lower, upper)


class QpSolver:
    """
    Minimises x'Hx/2 + g'x inside `ForceBounds` with daqp, a dual active-set method [Arnstrom2022].

    Counts `calls`, `failures` and failures in a row.
    """

    def __init__(self) -> None:
        self.calls = 0
        self.failures = 0
        self.failures_in_a_row = 0

    def restart_count(self) -> None:
        """Start counting failures in a row again; the totals stay."""
        self.failures_in_a_row = 0

    def solve(self, H: np.ndarray, g: np.ndarray, bounds: ForceBounds) -> np.ndarray | None:
        """Solution (n,), or None when the solver gives up, as it does of a problem with NaN."""
        self.calls += 1
        sense = None
        if bounds.soft:
            sense = np.zeros(len(bounds.upper), dtype=np.int32)
            sense[-bounds.soft :] = _SOFT
        x, _, flag, _ = daqp.solve(H, g, bounds.A, bounds.upper, bounds.lower, sense)
        if flag > 0 and _is_finite(x):
            self.failures_in_a_row = 0
            return np.asarray(x)
        self.failures += 1
        self.failures_in_a_row += 1
        return None


def _is_finite(numbers: np.ndarray) -> bool:
    """Whether nothing is NaN, infinite or beyond 1e150: their sum tells."""
    size: float = sum(map(abs, numbers.tolist()))
    return size < 1e150


class MpcProblem(NamedTuple):
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


class Horizon(NamedTuple):
    """
    N poses and rates from N steps of acceleration, and the costs of their errors.

    `pose_map` and `rate_map` are (N, N), `pose_weights` and `rate_weights` (6,); accelerations of
    steps s and r together cost the diagonal matrix of `costs[s, r]`, (N, N, 6). The body is known
    by its inverse inertia (3, 3); `force_weight` is the price of a force.
    """

    pose_map: np.ndarray
    rate_map: np.ndarray
    costs: np.ndarray
    pose_weights: np.ndarray
    rate_weights: np.ndarray
    inverse_inertia: np.ndarray
    force_weight: float


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
        self.pyramids = FrictionPyramids(params.friction, params.force_min, params.force_max)
        n, dt = params.steps, params.step
        self.times = dt * np.arange(n)
        end = np.arange(1, n + 1)[:, None]
        start = np.arange(n)[None, :]
        poses = np.where(start < end, dt * dt * (end - start - 0.5), 0.0)
        rates = np.where(start < end, dt, 0.0)
        pose, rate = np.array(params.pose_weights), np.array(params.rate_weights)
        costs = _squares(poses)[:, :, None] * pose + _squares(rates)[:, :, None] * rate
        # Not a flat record: each length of it would be compiled anew, while the robot walks.
        self._horizon = plain(
            Horizon(poses, rates, costs, pose, rate, self._inverse_inertia, params.force_weight)
        )

    def solve(self, problem: MpcProblem) -> np.ndarray | None:
        """
        Forces on the feet during the first step, yaw frame, shape (4, 3) [N]; zero in swing.

        None when the QP fails: the caller keeps its last forces.
        """
        count = int(problem.is_stance.sum())
        if count == 0:
            return np.zeros((4, 3))
        H, g = np.empty((3 * count, 3 * count)), np.empty(3 * count)
        _condense(self._horizon, plain(problem), H, g)
        forces = self.solver.solve(H, g, self.pyramids.bounds(count))
        if forces is None:
            return None
        first = np.zeros((4, 3))
        legs = np.flatnonzero(problem.is_stance[0])
        first[legs] = forces[: 3 * len(legs)].reshape(-1, 3) @ problem.ground.T
        return first


def _squares(steps: np.ndarray) -> np.ndarray:
    """S'S (N, N) for S (N, N), summed in the order of the rows."""
    return np.asarray(sum(np.multiply.outer(row, row) for row in steps))


@jit
def _condense(horizon: Horizon, problem: MpcProblem, H: np.ndarray, g: np.ndarray) -> None:
    """
    Write Hessian and gradient of the cost of stance forces, in ground axes.

    The force of a foot in step s accelerates the body by its columns of B, in that step alone, so
    that H = B' K B + R, with a matrix K_sr of steps s and r that is diagonal.
    """
    horizon, problem = Horizon(*horizon), MpcProblem(*problem)
    count = len(g)
    B, steps = _input_map(problem, horizon.inverse_inertia, count)
    slope = _slope(problem, horizon)
    costs = horizon.costs
    cost = np.empty((6, count))  # of the acceleration in a row's step with those of columns
    for row in range(count):
        step = steps[row]
        if row == 0 or step != steps[row - 1]:
            for k in range(6):
                for column in range(count):
                    cost[k, column] = costs[step, steps[column], k]
        total, line = 0.0, H[row]
        for column in range(count):
            line[column] = 0.0
        line[row] = horizon.force_weight
        for k in range(6):
            push, prices, pushes = B[k, row], cost[k], B[k]
            total += push * slope[step, k]
            for column in range(count):  # the innermost, as of these several are done at once
                line[column] += push * prices[column] * pushes[column]
        g[row] = total


@jit
def _input_map(
    problem: MpcProblem, inverse_inertia: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return B (6, m) from stance forces, three to a foot, to accelerations; the steps (m,)."""
    B, steps = np.empty((6, count)), np.empty(count, dtype=np.int64)
    c, axis = 0, np.empty(3)
    for n in range(len(problem.is_stance)):
        for leg in range(4):
            if not problem.is_stance[n, leg]:
                continue
            for i in range(3):
                for k in range(3):
                    axis[k] = problem.ground[k, i]
                turn = rotate(inverse_inertia, cross3(problem.arms[n, leg], axis))
                for k in range(3):
                    B[k, c], B[3 + k, c] = turn[k], axis[k] / problem.mass
                steps[c] = n
                c += 1
    return B, steps


@jit
def _slope(problem: MpcProblem, horizon: Horizon) -> np.ndarray:
    """Cost gradient with respect to the body accelerations at zero force, shape (N, 6)."""
    pose_map, rate_map = horizon.pose_map, horizon.rate_map
    N = len(pose_map)
    slope = np.zeros((N, 6))
    for n in range(N):
        past = pose_fall = 0.0
        for s in range(N):
            past += rate_map[n, s]
            pose_fall += pose_map[n, s]
        for k in range(6):
            fall = -GRAVITY if k == 5 else 0.0
            pose = problem.pose[k] + past * problem.rates[k] + fall * pose_fall
            pose = (pose - problem.pose_reference[n, k]) * horizon.pose_weights[k]
            rate = problem.rates[k] + fall * past - problem.rate_reference[n, k]
            rate *= horizon.rate_weights[k]
            for s in range(N):
                slope[s, k] += pose_map[n, s] * pose + rate_map[n, s] * rate
    return slope
