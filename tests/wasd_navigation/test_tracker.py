# SPDX-License-Identifier: Apache-2.0
"""A pose followed by odometry and scans: scales are learnt, slipping wheels are found out."""

import math

from lidar_room import look
import numpy as np
import pytest
from wasd_navigation.mapping.local_map import add_surfaces, fit_scan, LocalMap, make_local_map
from wasd_navigation.mapping.surface import find_surface, Noise
from wasd_navigation.mapping.tracker import STUCK_LAST, Tracker
from wasd_navigation.records import Scan
from wasd_navigation.se2 import compose, inverse

NOISE = Noise(0.012, 0.0)
# Odometry says of itself that it is off by 3 cm after a metre [m^2/m], and so for turns.
GROWTH = 9e-4


@pytest.fixture(scope='module')
def room() -> LocalMap:
    """Return the surfaces of the room, seen from its middle without noise."""
    local = make_local_map(6.0)
    local.clear(np.zeros(2))
    scan = look(np.zeros(3), Quiet(), with_box=True)  # type: ignore[arg-type]
    points = find_surface(scan, NOISE).points
    begins = np.array((0, len(points)))
    add_surfaces(local, np.zeros((1, 3)), points, begins)
    return local


class Quiet:
    """Draws no noise."""

    def normal(self, size: int) -> np.ndarray:
        """Return zeros."""
        return np.zeros(size)


def drive(room: LocalMap, poses: np.ndarray, odometry: np.ndarray, tracker: Tracker) -> list[bool]:
    """Let a tracker follow true poses; return at which scans the wheels have slipped."""
    random, slips = np.random.default_rng(3), []
    way = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(odometry[:, :2], axis=0).T))))
    tracker.move(odometry[0], np.zeros((3, 3)))
    tracker.put(poses[0], 1e-8 * np.eye(3))
    for pose, said, far in zip(poses[1:], odometry[1:], way[1:], strict=True):
        tracker.move(said, GROWTH * far * np.diag((1.0, 1.0, 0.1)))
        surface = find_surface(look(pose, random, with_box=True), NOISE).points
        fit = tracker.fit(room, surface)
        assert fit.share > 0.8
        tracker.believe(fit)
        slips.append(tracker.has_slipped)
    return slips


def wrong(poses: np.ndarray, way: float, turn: float) -> np.ndarray:
    """Return what odometry says whose way and turns are off by factors."""
    said = [poses[0]]
    for before, after in zip(poses, poses[1:], strict=False):
        move = compose(inverse(before), after)
        said.append(compose(said[-1], move * (way, way, turn)))
    return np.array(said)


def arc(count: int) -> np.ndarray:
    """Return poses on a circle of 0.8 m about (0, 0.8), 5 cm from one to the next."""
    turns = 0.05 / 0.8 * np.arange(count)
    return np.stack((0.8 * np.sin(turns), 0.8 * (1.0 - np.cos(turns)), turns), axis=1)


@pytest.mark.parametrize(('way', 'turn'), [(1.03, 0.97), (0.95, 1.02)])
def test_it_learns_by_how_much_odometry_is_off(room: LocalMap, way: float, turn: float) -> None:
    tracker, poses = Tracker(0.012), arc(120)
    slips = drive(room, poses, wrong(poses, way, turn), tracker)
    assert math.dist(tracker.pose[:2], poses[-1, :2]) < 0.01
    assert 1.0 + tracker.scales == pytest.approx([1.0 / way, 1.0 / turn], abs=0.01)
    assert not any(slips)
    assert not tracker.is_stuck


def test_wheels_that_spin_while_the_robot_stands_are_found_out(room: LocalMap) -> None:
    """Twenty scans of driving, then as many of a robot at a sill: 5 cm of way said at each."""
    tracker = Tracker(0.012)
    said = np.zeros((40, 3))
    said[:, 0] = -0.5 + 0.05 * np.arange(40)
    poses = said.copy()
    poses[20:, 0] = poses[19, 0]
    slips = drive(room, poses[:25], said[:25], tracker)
    assert not any(slips[:19])
    assert any(slips[19:])
    tracker = Tracker(0.012)
    slips = drive(room, poses, said, tracker)
    assert math.dist(tracker.pose[:2], poses[-1, :2]) < 0.02
    assert tracker.is_stuck


def test_a_robot_that_turns_away_from_a_sill_is_stuck_no_more(room: LocalMap) -> None:
    """Ten scans of driving, ten at a sill, then a turn in place, 12 degrees at each scan."""
    tracker = Tracker(0.012)
    said = np.zeros((28, 3))
    said[:20, 0] = -0.5 + 0.05 * np.arange(20)
    said[20:, 0], said[20:, 2] = said[19, 0], 0.2 * np.arange(1, 9)
    poses = said.copy()
    poses[10:, 0] = poses[9, 0]
    drive(room, poses[:20], said[:20], tracker)
    assert tracker.is_stuck
    tracker = Tracker(0.012)
    slips = drive(room, poses, said, tracker)
    assert not any(slips[-STUCK_LAST:])
    assert not tracker.is_stuck


def test_a_fit_says_nothing_of_the_way_along_a_wall() -> None:
    """Of two walls, 2 m apart and longer than the lidar sees."""
    angles = np.linspace(-math.pi, math.pi, 360)
    ranges = np.minimum(1.0 / np.maximum(1e-9, np.abs(np.sin(angles))), 6.0)
    hits = ranges < 6.0
    random = np.random.default_rng(4)

    def see() -> np.ndarray:
        noisy = ranges * (1.0 + 0.01 * random.normal(size=360))
        ends = np.stack((noisy * np.cos(angles), noisy * np.sin(angles)), axis=1)
        return find_surface(Scan(np.zeros(2), ends, hits), Noise(0.012, 0.01)).points

    local = make_local_map(8.0)
    local.clear(np.zeros(2))
    points = see()
    begins = np.array((0, len(points)))
    add_surfaces(local, np.zeros((1, 3)), points, begins)
    start = np.array((0.3, 0.04, 0.02))
    pose, information, _ = fit_scan(local, see(), start, np.diag((1e2, 1e2, 1e2)), 0.012, 12)
    assert pose[1:] == pytest.approx((0.0, 0.0), abs=0.01)
    assert pose[0] == pytest.approx(start[0], abs=0.02)
    assert information[0, 0] < 0.02 * information[1, 1]
