# SPDX-License-Identifier: Apache-2.0
"""The pose graph: what is consistent is found again, in portions as at once."""

from collections.abc import Sequence
import math

import numpy as np
import pytest
from wasd_navigation.mapping.pose_graph import (
    Edges,
    factorise,
    find_pattern,
    linearise,
    solve,
    Solver,
)
from wasd_navigation.se2 import compose, inverse

COUNT = 60


def ring() -> np.ndarray:
    """Return poses that go round a ring twice, shape (n, 3)."""
    turns = np.linspace(0.0, 4.0 * math.pi, COUNT)
    poses = np.stack((3.0 * np.cos(turns), 3.0 * np.sin(turns), turns), axis=1)
    poses[:, 2] = np.mod(poses[:, 2] + math.pi, 2.0 * math.pi) - math.pi
    return poses


def link(poses: np.ndarray, noise: float, more: Sequence[tuple[int, int]] = ()) -> Edges:
    """Return edges from each pose to the next, to the one a round before, and more."""
    pairs = [*more, *((i - 1, i) for i in range(1, COUNT))]
    pairs += [(i - COUNT // 2, i) for i in range(COUNT // 2, COUNT)]
    random = np.random.default_rng(0)
    seen = [compose(inverse(poses[a]), poses[b]) for a, b in pairs]
    seen_poses = np.array(seen) + noise * random.normal(size=(len(pairs), 3))
    A = random.normal(size=(len(pairs), 3, 3))
    known = A @ A.transpose(0, 2, 1) + np.diag((100.0, 100.0, 400.0))
    return Edges(np.array(pairs), seen_poses, known, np.zeros(len(pairs), dtype=np.bool_))


def errors(poses: np.ndarray, edges: Edges) -> np.ndarray:
    """Return the whitened errors of all edges, shape (3 e,)."""
    whole = []
    for (a, b), seen, known in zip(edges.pairs, edges.poses, edges.informations, strict=True):
        error = compose(inverse(poses[a]), poses[b]) - seen
        error[2] = math.remainder(error[2], 2.0 * math.pi)
        whole.append(np.linalg.cholesky(known).T @ error)
    return np.concatenate(whole)


def settle(poses: np.ndarray, edges: Edges) -> np.ndarray:
    solver = Solver()
    solver.ask()
    for _ in range(100):
        if not solver.work(poses, lambda: edges):
            break
    settled = solver.take()
    assert settled is not None and solver.take() is None
    return settled


def test_edges_that_agree_give_their_poses() -> None:
    true = ring()
    start = true + 0.05 * np.random.default_rng(1).normal(size=true.shape)
    start[0] = true[0]
    settled = settle(start, link(true, 0.0))
    away = settled - true
    away[:, 2] = np.mod(away[:, 2] + math.pi, 2.0 * math.pi) - math.pi
    assert np.abs(away).max() < 1e-6


# A place that is seen again from everywhere has more neighbours than there is room for at first.
HUB = [(1, other) for other in range(3, COUNT, 2)]


@pytest.mark.slow
@pytest.mark.parametrize('more', [(), HUB], ids=['rounds', 'hub'])
def test_a_step_is_that_of_dense_least_squares(more: Sequence[tuple[int, int]]) -> None:
    poses, edges = ring(), link(ring(), 0.02, more)
    pattern = find_pattern(COUNT, edges.pairs)
    system = linearise(poses, edges, pattern)
    assert factorise(system, pattern, 0, 10**9) == len(pattern.order)
    step = 1e-6
    base = errors(poses, edges)
    J = np.empty((len(base), 3 * COUNT))
    for column in range(3 * COUNT):
        moved = poses.copy()
        moved[column // 3, column % 3] += step
        J[:, column] = (errors(moved, edges) - base) / step
    expected = np.linalg.lstsq(J[:, 3:], -base, rcond=None)[0]
    found = solve(system, pattern)
    assert found[0] == pytest.approx(np.zeros(3))
    assert found[1:].ravel() == pytest.approx(expected, abs=1e-5)


def test_portions_change_nothing() -> None:
    edges = link(ring(), 0.02)
    pattern = find_pattern(COUNT, edges.pairs)
    whole, parts = (linearise(ring(), edges, pattern) for _ in range(2))
    factorise(whole, pattern, 0, 10**9)
    turn, portions = 0, 0
    while turn < len(pattern.order):
        turn = factorise(parts, pattern, turn, 20)
        portions += 1
    assert portions > 5
    assert np.array_equal(solve(whole, pattern), solve(parts, pattern))


def test_an_edge_that_is_wrong_gives_way_where_it_may_be_wrong() -> None:
    true = ring()
    edges = link(true, 0.0)
    edges.poses[-5] += (1.0, -1.0, 0.5)
    robust = edges._replace(robust=np.arange(len(edges.pairs)) >= COUNT - 1)
    away = [np.abs(settle(true, each)[:, :2] - true[:, :2]).max() for each in (edges, robust)]
    assert away[1] < 0.3 * away[0]
