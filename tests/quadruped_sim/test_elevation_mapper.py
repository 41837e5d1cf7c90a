# SPDX-License-Identifier: Apache-2.0
"""Clouds become a map by odometry, each point from where its base then was."""

import math

import numpy as np
import pytest
from quadruped_sim.elevation_mapper import ElevationMapper
from wasd_core.rotations import Pose

POINT = np.dtype([('x', 'f4'), ('y', 'f4'), ('z', 'f4'), ('time', 'f4')])
MOUNT = Pose(np.array([0.3, 0.0, 0.1]), np.eye(3))


def at(x, z=0.3):
    """Return the pose of a base that is level."""
    return np.array([x, 0.0, z]), np.array([1.0, 0.0, 0.0, 0.0])


def cloud(points, times):
    """Return a cloud of points (n, 3) [m] of the lidar's frame."""
    found = np.zeros(len(points), POINT)
    found['x'], found['y'], found['z'] = np.asarray(points).T
    found['time'] = times
    return found


def test_a_point_is_placed_from_where_the_base_was_when_it_was_seen():
    mapper = ElevationMapper(MOUNT)
    for step in range(11):
        mapper.take_pose(1.0 + 0.01 * step, *at(0.1 * step))
    # Of a base that moves at 10 m/s: the same place, 2.3 m ahead of the start, seen twice.
    seen = [(2.0, 0.5, -0.4), (1.5, 0.5, -0.4)]
    assert mapper.take_cloud(1.0, cloud(seen, [0.0, 0.05]))
    heights = mapper.elevation.heights()
    assert np.isfinite(heights).sum() == 1
    assert mapper.elevation.at(2.3, 0.5) == pytest.approx(0.0, abs=1e-6)


def test_before_there_is_odometry_a_cloud_is_not_placed():
    mapper = ElevationMapper(MOUNT)
    assert not mapper.take_cloud(1.0, cloud([(1.0, 0.0, -0.4)], [0.0]))
    assert np.isnan(mapper.elevation.heights()).all()


def seen_at_once(points):
    """Return the heights of a map of points that are seen one right after the other."""
    mapper = ElevationMapper(MOUNT)
    mapper.take_pose(1.0, *at(0.0))
    mapper.take_cloud(1.0, cloud(points, np.arange(len(points)) / 21_600))
    return mapper.elevation.heights()


def test_points_of_a_riser_are_no_ground_and_those_of_a_slope_of_30_degrees_are():
    rise = np.arange(10) * 0.03
    ahead = np.full(10, 1.0)
    riser = np.stack((ahead, 0.0 * rise, rise - 0.4), axis=1)
    assert np.isnan(seen_at_once(riser)).all()
    slope = riser + np.outer(rise / math.tan(math.radians(30.0)), (1.0, 0.0, 0.0))
    heights = seen_at_once(slope)
    assert np.isfinite(heights).sum() >= 8


def test_what_is_out_of_sight_follows_odometry_s_height_as_what_is_in_sight_does():
    """While the robot looks to the left alone, its odometry rises by 20 cm on a level floor."""
    rng = np.random.default_rng(112)
    mapper = ElevationMapper(MOUNT)
    for step in range(41):
        risen = 0.005 * step
        mapper.take_pose(1.0 + 0.1 * step, *at(0.0, 0.3 + risen))
        places = rng.uniform(-1.5, 1.5, (1500, 2))
        if step > 5:
            places[:, 1] = np.abs(places[:, 1])
        floor = np.column_stack((places - (0.3, 0.0), rng.normal(-0.4, 0.005, len(places))))
        floor[::20, 2] += 0.15  # one in twenty is wrong
        mapper.take_cloud(1.0 + 0.1 * step, cloud(floor, np.zeros(len(floor))))
    for y in (-1.0, 1.0):
        heights = mapper.elevation.at(np.linspace(-1.0, 1.0, 40), np.full(40, y))
        assert np.nanmedian(heights) == pytest.approx(0.2, abs=0.006)


def test_time_that_begins_again_and_a_reset_forget_the_map():
    mapper = ElevationMapper(MOUNT)
    mapper.take_pose(5.0, *at(0.0))
    mapper.take_cloud(5.0, cloud([(1.0, 0.0, -0.4)], [0.0]))
    mapper.take_pose(0.1, *at(0.0))
    assert np.isnan(mapper.elevation.heights()).all()
    mapper.take_cloud(0.1, cloud([(1.0, 0.5, -0.4)], [0.0]))
    assert np.isfinite(mapper.elevation.heights()).sum() == 1
    mapper.reset()
    assert np.isnan(mapper.elevation.heights()).all()
    assert not mapper.take_cloud(0.2, cloud([(1.0, 0.5, -0.4)], [0.0]))


def test_an_empty_cloud_changes_nothing():
    mapper = ElevationMapper(MOUNT)
    mapper.take_pose(1.0, *at(0.0))
    assert mapper.take_cloud(1.0, cloud(np.empty((0, 3)), []))
    assert np.isnan(mapper.elevation.heights()).all()
