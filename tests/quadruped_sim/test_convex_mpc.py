# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from quadruped_sim.locomotion import convex_mpc
from quadruped_sim.locomotion.convex_mpc import ConvexMpc, FrictionPyramids, MpcProblem, QpSolver
from quadruped_sim.tuning import MpcParameters

MASS = 16.0
INERTIA = np.diag((0.2, 0.5, 0.55))
ARMS = np.array(
    ((0.19, 0.14, -0.28), (0.19, -0.14, -0.28), (-0.19, 0.14, -0.28), (-0.19, -0.14, -0.28))
)


def problem(params, stance, pose=None, rates=None):
    n = params.steps
    return MpcProblem(
        mass=MASS,
        pose=np.zeros(6) if pose is None else pose,
        rates=np.zeros(6) if rates is None else rates,
        pose_reference=np.zeros((n, 6)),
        rate_reference=np.zeros((n, 6)),
        is_stance=np.tile(stance, (n, 1)),
        arms=np.tile(ARMS, (n, 1, 1)),
        ground=np.eye(3),
    )


def kkt_residual(H, g, bounds, x):
    """Distance of -gradient from the cone of active constraint normals, at most."""
    count = len(g)
    rows = np.vstack((np.eye(count), bounds.A))
    value = rows @ x
    assert (value <= bounds.upper + 1e-6).all()
    assert (value >= bounds.lower - 1e-6).all()
    active = [rows[i] for i in range(len(rows)) if value[i] > bounds.upper[i] - 1e-5]
    active += [-rows[i] for i in range(len(rows)) if value[i] < bounds.lower[i] + 1e-5]
    gradient = H @ x + g
    if not active:
        return np.linalg.norm(gradient)
    # Any weights >= 0 give an upper bound; coordinate descent finds those of the distance.
    N = np.array(active).T
    weights, rest = np.zeros(len(active)), gradient.copy()
    largest = 1.0
    while largest > 1e-9:
        largest = 0.0
        for column, normal in enumerate(N.T):
            step = max(-weights[column], -(normal @ rest) / (normal @ normal))
            weights[column] += step
            rest += step * normal
            largest = max(largest, abs(step))
    return np.linalg.norm(gradient + N @ weights)


def test_solutions_satisfy_the_optimality_conditions(rng):
    solver, pyramids = QpSolver(), FrictionPyramids(0.5, 5.0, 260.0)
    for count in (1, 2, 4, 12):
        for _ in range(5):
            L = rng.normal(size=(3 * count, 3 * count))
            H = L @ L.T + 0.1 * np.eye(3 * count)
            g = 200.0 * rng.normal(size=3 * count)
            x = solver.solve(H, g, pyramids.bounds(count))
            assert kkt_residual(H, g, pyramids.bounds(count), x) < 1e-5 * np.linalg.norm(g)
    assert solver.failures == 0


def by_hildreth(H, g, bounds):
    """Minimise x H x / 2 + g x by coordinate ascent on its dual (Hildreth 1957)."""
    rows = np.vstack((np.eye(len(g)), bounds.A))
    C, d = np.vstack((rows, -rows)), np.concatenate((bounds.upper, -bounds.lower))
    finite = np.isfinite(d) & (abs(d) < 1e20)
    C, d = C[finite], d[finite]
    inverse = np.linalg.inv(H)
    M, offset = C @ inverse @ C.T, d + C @ inverse @ g
    y = np.zeros(len(d))
    before = np.ones(len(d))
    while abs(y - before).max() > 1e-9:
        before = y.copy()
        for i in range(len(d)):
            y[i] = max(0.0, y[i] - (M[i] @ y + offset[i]) / M[i, i])
    return -inverse @ (g + C.T @ y)


@pytest.mark.slow
def test_solutions_equal_those_of_an_independent_solver(rng):
    solver, pyramids = QpSolver(), FrictionPyramids(0.5, 5.0, 260.0)
    for _ in range(3):
        L = rng.normal(size=(6, 6))
        H, g = L @ L.T + 0.5 * np.eye(6), 100.0 * rng.normal(size=6)
        bounds = pyramids.bounds(2)
        x = solver.solve(H, g, bounds)
        np.testing.assert_allclose(x, by_hildreth(H, g, bounds), atol=1e-2)


def test_nan_fails_is_counted_and_recovers():
    solver, bounds = QpSolver(), FrictionPyramids(0.5, 5.0, 260.0).bounds(1)
    assert solver.solve(np.eye(3), np.full(3, np.nan), bounds) is None
    assert (solver.failures, solver.failures_in_a_row) == (1, 1)
    assert solver.solve(np.eye(3), np.zeros(3), bounds) is not None
    assert (solver.failures, solver.failures_in_a_row) == (1, 0)


@pytest.mark.parametrize('wrong', [np.nan, np.inf, -np.inf, 1e200])
def test_what_is_not_finite_has_no_solution(rng, wrong):
    solver, pyramids = QpSolver(), FrictionPyramids(0.5, 5.0, 260.0)
    for count in (1, 2, 12):
        for _ in range(20):
            L = rng.normal(size=(3 * count, 3 * count))
            problem = L @ L.T + 0.1 * np.eye(3 * count), rng.normal(size=3 * count)
            part = problem[rng.integers(2)]
            part[tuple(rng.integers(part.shape))] = wrong
            assert solver.solve(*problem, pyramids.bounds(count)) is None
    assert solver.failures == solver.calls == 60


def test_at_rest_the_feet_carry_the_weight_evenly():
    params = MpcParameters(force_weight=1e-9)
    forces = ConvexMpc(params, INERTIA).solve(problem(params, (True,) * 4))
    np.testing.assert_allclose(forces.sum(axis=0), (0.0, 0.0, MASS * 9.81), atol=0.05)
    np.testing.assert_allclose(forces[:, 2], MASS * 9.81 / 4.0, atol=0.05)
    moment = np.cross(ARMS, forces).sum(axis=0)
    np.testing.assert_allclose(moment, 0.0, atol=0.02)


def test_a_swing_foot_gets_no_force_and_flight_none_at_all():
    params = MpcParameters()
    mpc = ConvexMpc(params, INERTIA)
    forces = mpc.solve(problem(params, (True, False, False, True)))
    np.testing.assert_array_equal(forces[[1, 2]], 0.0)
    np.testing.assert_array_equal(mpc.solve(problem(params, (False,) * 4)), 0.0)


def test_forces_stay_inside_the_friction_pyramid_under_a_hard_push():
    params = MpcParameters()
    rates = np.array((0.0, 0.0, 0.0, 3.0, -3.0, 0.0))
    forces = ConvexMpc(params, INERTIA).solve(problem(params, (True,) * 4, rates=rates))
    assert (np.abs(forces[:, :2]) <= params.friction * forces[:, 2:] + 1e-6).all()
    assert (forces[:, 2] <= params.force_max + 1e-6).all()
    assert forces[:, 0].sum() < -10.0
    assert forces[:, 1].sum() > 10.0


def test_a_roll_to_the_right_is_answered_by_the_right_feet():
    params = MpcParameters()
    pose = np.array((0.2, 0.0, 0.0, 0.0, 0.0, 0.0))
    forces = ConvexMpc(params, INERTIA).solve(problem(params, (True,) * 4, pose=pose))
    assert forces[[1, 3], 2].sum() > forces[[0, 2], 2].sum() + 10.0


def test_a_horizon_of_another_length_compiles_nothing_while_it_walks():
    mpc = ConvexMpc(MpcParameters(), INERTIA)
    mpc.solve(problem(MpcParameters(), (True,) * 4))
    compiled = set(convex_mpc._condense.signatures)
    other = MpcParameters(steps=MpcParameters().steps + 3)
    mpc.tune(other)
    assert mpc.solve(problem(other, (True,) * 4)) is not None
    assert set(convex_mpc._condense.signatures) == compiled
