# SPDX-License-Identifier: Apache-2.0
"""Poses in the plane, rays of a lidar, cells of a grid."""

import math

import numpy as np
import pytest
from wasd_navigation.grid import Grid
from wasd_navigation.scan import read_scan
from wasd_navigation.se2 import compose
from wasd_navigation.se2 import inverse
from wasd_navigation.se2 import transform


def test_a_pose_and_its_inverse_are_no_motion() -> None:
    pose = np.array((1.0, -2.0, 2.5))
    assert compose(pose, inverse(pose)) == pytest.approx(np.zeros(3), abs=1e-15)
    assert compose(inverse(pose), pose) == pytest.approx(np.zeros(3), abs=1e-15)


def test_composed_poses_move_points_one_after_the_other() -> None:
    first, second = np.array((1.0, 2.0, 0.3)), np.array((-0.5, 0.7, 3.0))
    points = np.random.default_rng(0).normal(size=(5, 2))
    expected = transform(first, transform(second, points))
    assert transform(compose(first, second), points) == pytest.approx(expected)


def test_a_scan_is_points_in_the_base_frame() -> None:
    angles = np.array((0.0, math.pi / 2, 0.0, 0.1, 0.2))
    ranges = np.array((1.0, 2.0, math.inf, -math.inf, math.nan))
    scan = read_scan(ranges, angles, (0.1, 4.0), np.array((0.1, 0.0, math.pi / 2)))
    assert scan.points == pytest.approx(np.array(((0.1, 1.0), (-1.9, 0.0))))
    assert scan.ends[2] == pytest.approx((0.1, 4.0))
    assert scan.hits.tolist() == [True, True, False]
    assert scan.origin == pytest.approx((0.1, 0.0))


def test_centres_of_cells_lie_in_their_cells() -> None:
    grid = Grid(np.zeros((3, 4), dtype=np.int8), 0.05, (-1.0, 2.0))
    cells = np.array(((0, 0), (2, 3), (1, 2)))
    assert np.array_equal(grid.to_cells(grid.to_points(cells)), cells)
    assert grid.to_points(cells[:1])[0] == pytest.approx((-0.975, 2.025))
    assert grid.covers(np.array(((2, 3), (3, 0), (0, -1)))).tolist() == [True, False, False]
