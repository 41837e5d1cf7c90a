# SPDX-License-Identifier: Apache-2.0
"""Slopes in scans of a planar lidar that sways: where they are kept out of the map."""

from dataclasses import replace
import math

from navigation_stand_ins import navigator, odometry, scan
import numpy as np
import pytest
from wasd_core.rotations import Pose, rpy_matrix
from wasd_navigation.records import read_scan, Scan
from wasd_navigation.slopes import COMPARED, Slopes

ANGLES = np.linspace(-0.4, 0.4, 47)
SWAY = (0.0, 0.01, -0.01, 0.0, 0.01, -0.01)  # of a trunk in a trot [rad]


def seen(slopes, lean, pitch, height=0.4, at=0.0):
    """
    Return which rays count as hits in the next scan, from x = `at`, of a surface.

    It begins 3 m ahead of x = 0 and leans away by an angle from the level [rad]; the lidar is at
    a height [m] and looks down by `pitch` [rad].
    """
    mount = Pose(np.array([0.0, 0.0, height]), rpy_matrix(0.0, pitch, 0.0))
    along = np.stack((np.cos(ANGLES), np.sin(ANGLES), np.zeros_like(ANGLES)), 1) @ mount.rotation.T
    # sin(lean) (x - 3) = cos(lean) z
    sin, cos = math.sin(lean), math.cos(lean)
    ranges = (height * cos + (3.0 - at) * sin) / (sin * along[:, 0] - cos * along[:, 2])
    noise = np.random.default_rng(int(1e3 * abs(pitch) + 1e3 * at)).normal(0.0, 0.01, len(ANGLES))
    rays = read_scan(ranges + noise, ANGLES, (0.1, 12.0), mount)
    assert rays.hits.all() and len(rays.hits) == len(ANGLES)
    return slopes.leave_out(rays, np.array((at, 0.0, 0.0))).hits


@pytest.mark.parametrize('degrees', [5, 10, 15, 30])
def test_a_slope_is_no_hit_once_the_lidar_has_swayed_before_it(degrees) -> None:
    slopes = Slopes()
    for pitch in SWAY:
        hits = seen(slopes, math.radians(degrees), pitch)
    assert np.mean(hits) < 0.1


def test_a_slope_is_no_hit_while_the_robot_stands_up_before_it() -> None:
    slopes = Slopes()
    for height in (0.2, 0.2, 0.2, 0.2, 0.23):
        hits = seen(slopes, math.radians(10), 0.0, height)
    assert not hits.any()


def test_a_wall_stays_a_hit_however_the_lidar_sways_and_moves() -> None:
    slopes = Slopes()
    for index, pitch in enumerate(5 * SWAY):
        hits = seen(slopes, math.radians(90), 3.0 * pitch, at=0.05 * index)
        assert np.mean(hits) > 0.95


def test_the_edge_of_a_table_before_a_wall_stays_a_hit() -> None:
    slopes, everywhere = Slopes(), []
    for pitch in 0.03 * np.sin(np.arange(40.0)):
        heights = np.full(len(ANGLES), 0.4 - 3.0 * pitch)  # the top is 0.4 m high, 3 m ahead
        ways = np.where(heights < 0.4, 3.0, 6.0)[:, None]
        ends = ways * np.stack((np.cos(ANGLES), np.sin(ANGLES)), 1)
        rays = Scan(np.zeros(2), ends, np.ones(len(ends), bool), heights=heights)
        everywhere.append(slopes.leave_out(rays, np.zeros(3)).hits)
    assert np.mean(everywhere[COMPARED:]) > 0.95


def test_a_lidar_that_does_not_sway_leaves_all_hits_where_they_are() -> None:
    slopes = Slopes()
    for index in range(10):
        assert seen(slopes, math.radians(15), 0.0, at=0.05 * index).all()


def test_who_forgets_the_scans_before_knows_no_slope() -> None:
    slopes = Slopes()
    for pitch in SWAY:
        seen(slopes, math.radians(10), pitch)
    slopes.reset()
    assert seen(slopes, math.radians(10), 0.0).all()


def test_a_navigator_matches_no_slope_but_lets_the_driver_see_it() -> None:
    made = navigator()
    for height in (0.3, 0.3, 0.3, 0.3, 0.33):
        heights = np.full(1, height)
        ahead = replace(scan((height / math.tan(0.1), 0.0)), heights=heights)
        made.see(ahead, odometry())
    assert not made.locator.steps[-1][0].hits.any()
    made.set_goal(np.array((1.0, 0.0, 0.0)))
    made.step(0.05)
    assert made.pilot.steps[-1][1].hits.all()
