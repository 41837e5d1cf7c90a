# SPDX-License-Identifier: Apache-2.0
"""Poses in the plane, rays of a lidar, cells of a grid."""

import math

import numpy as np
import pytest
from wasd_core.rotations import Pose, rpy_matrix
from wasd_navigation.records import Grid, read_scan
from wasd_navigation.se2 import compose, inverse, transform


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
    mount = Pose(np.array((0.1, 0.0, 1.0)), rpy_matrix(0.0, 0.0, math.pi / 2))
    scan = read_scan(ranges, angles, (0.1, 4.0), mount)
    assert scan.points == pytest.approx(np.array(((0.1, 1.0), (-1.9, 0.0))))
    assert scan.ends[2] == pytest.approx((0.1, 4.0))
    assert scan.hits.tolist() == [True, True, False]
    assert scan.origin == pytest.approx((0.1, 0.0))


@pytest.mark.parametrize('count', [1, 2, 3])
def test_a_scan_of_few_rays_that_hit_nothing_sees_free_space(count) -> None:
    scan = read_scan(np.full(count, math.inf), np.linspace(0.0, 0.2, count), (0.1, 4.0))
    assert len(scan.ends) == count


def test_a_range_of_0_tells_nothing_whatever_the_lidar_says_is_its_least() -> None:
    scan = read_scan(np.array((0.0, 0.0, math.inf, 2.0)), np.zeros(4), (0.0, 4.0))
    assert scan.hits.tolist() == [False, True]


def test_centres_of_cells_lie_in_their_cells() -> None:
    grid = Grid(np.zeros((3, 4), dtype=np.int8), 0.05, (-1.0, 2.0))
    cells = np.array(((0, 0), (2, 3), (1, 2)))
    assert np.array_equal(grid.to_cells(grid.to_points(cells)), cells)
    assert grid.to_points(cells[:1])[0] == pytest.approx((-0.975, 2.025))
    assert grid.covers(np.array(((2, 3), (3, 0), (0, -1)))).tolist() == [True, False, False]


def tilted(pitch: float, height: float) -> Pose:
    """Return a lidar at a height [m] that looks down by an angle [rad]."""
    return Pose(np.array([0.0, 0.0, height]), rpy_matrix(0.0, pitch, 0.0))


def test_a_tilted_ray_reaches_less_far_as_seen_from_above() -> None:
    scan = read_scan(np.array([2.0]), np.zeros(1), (0.1, 6.0), tilted(0.1, 0.4))
    assert scan.points == pytest.approx(np.array([[2.0 * math.cos(0.1), 0.0]]))


def test_a_ray_that_ends_on_the_floor_tells_nothing() -> None:
    ranges = np.array([3.0, 4.0])  # 0.3 m and 0.4 m down
    scan = read_scan(ranges, np.zeros(2), (0.1, 6.0), tilted(0.1, 0.4))
    assert len(scan.ends) == 1


def test_a_level_lidar_at_any_height_sees_all() -> None:
    for height in (0.0, 0.02, 0.4):
        scan = read_scan(np.array([6.0]), np.zeros(1), (0.1, 6.0), tilted(0.0, height))
        assert len(scan.points) == 1


def test_a_lidar_upside_down_sees_left_on_the_right() -> None:
    mount = Pose(np.array([0.0, 0.0, 0.3]), rpy_matrix(math.pi, 0.0, 0.0))
    scan = read_scan(np.array([1.0]), np.array([math.pi / 2.0]), (0.1, 6.0), mount)
    assert scan.points == pytest.approx(np.array([[0.0, -1.0]]))
