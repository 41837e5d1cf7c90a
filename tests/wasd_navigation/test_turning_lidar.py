# SPDX-License-Identifier: Apache-2.0
"""Scans whose rays are of different times, as seen from where the base is half way through."""

import math

from cases import for_all
from lidar_room import RAYS, ROOM
import numpy as np
import pytest
from wasd_core.robot_io import BaseOdometry
from wasd_core.rotations import Pose
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.odometry import moves_between
from wasd_navigation.parameters import NavigatorParameters
from wasd_navigation.parts import make_pilot
from wasd_navigation.records import Ranges, read_scan, Scan
from wasd_navigation.robot_navigator import RobotNavigator
from wasd_navigation.se2 import compose, inverse, transform

LIMITS, SWEEP = (0.1, 10.0), 0.18


def twisted(speed: float, rate: float, time: np.ndarray) -> np.ndarray:
    """Return poses of a base that has driven an arc from the origin, shape (n, 3)."""
    if rate == 0.0:
        return np.stack((speed * time, 0.0 * time, 0.0 * time), axis=1)
    turn = rate * time
    return np.stack((np.sin(turn), 1.0 - np.cos(turn), turn * rate / speed), axis=1) * speed / rate


def ranges_of(poses: np.ndarray) -> np.ndarray:
    """Return how far rays are from the walls of the room, each from its own pose."""
    heading = RAYS + poses[:, 2]
    directions = np.stack((np.cos(heading), np.sin(heading)), axis=1)
    low = (np.array(ROOM[:2]) - poses[:, :2]) / directions
    high = (np.array(ROOM[2:]) - poses[:, :2]) / directions
    ranges: np.ndarray = np.maximum(low, high).min(axis=1)
    return ranges


def off_walls(pose: np.ndarray, scan: Scan) -> float:
    """Return how far an end of a scan from a pose is off the walls at most [m]."""
    ends = transform(pose, scan.ends)
    sides = [np.abs(ends[:, axis] - ROOM[axis + 2 * k]) for axis in (0, 1) for k in (0, 1)]
    return float(np.min(sides, axis=0).max())


@for_all(('speed', 'rate'), [(0.5, 0.0), (0.5, 1.5), (0.4, -1.0)])
def test_walls_are_straight_again_whichever_way_the_base_has_moved(
    speed: float, rate: float
) -> None:
    times = np.linspace(0.0, SWEEP, len(RAYS))
    poses = twisted(speed, rate, times)
    middle = twisted(speed, rate, np.array([0.5 * SWEEP]))[0]
    ranges = ranges_of(poses)
    moved = moves_between(middle, poses)
    mount = Pose(np.array((0.1, 0.0, 1.0)), np.eye(3))
    scan = read_scan(ranges, RAYS, LIMITS, mount, moved)
    assert scan.origin == pytest.approx((0.1, 0.0))
    there = read_scan(ranges_of(poses), RAYS, LIMITS, moved=moved)
    assert scan.begins[0] == pytest.approx(compose(moved[0], np.array((0.1, 0.0, 0.0)))[:2])
    assert off_walls(middle, there) < 1e-9
    # As rays of one instant they are centimetres off.
    assert off_walls(middle, read_scan(ranges, RAYS, LIMITS)) > 0.03


def base_at(pose: np.ndarray) -> BaseOdometry:
    """Return odometry that says so."""
    half = 0.5 * float(pose[2])
    return BaseOdometry(
        np.array((*pose[:2], 0.0)),
        np.array((math.cos(half), 0.0, 0.0, math.sin(half))),
        np.zeros(3),
        np.zeros(3),
        np.zeros((6, 6)),
        np.zeros((6, 6)),
    )


class Locator(Mapper):
    """Keeps the scans that it is given, with odometry's poses."""

    def step(self, scan, odometry, covariance) -> None:  # type: ignore[no-untyped-def]
        """Keep them."""
        self.seen = scan, odometry


@pytest.fixture
def navigation() -> RobotNavigator:
    settings, mapper = NavigatorParameters(), Locator()
    navigation = RobotNavigator(settings, (mapper, make_pilot(settings)))
    navigation.warn = navigation.say = pytest.fail
    return navigation


def said(ranges: np.ndarray, increment: float) -> Ranges:
    """Return what a LaserScan says."""
    return Ranges(ranges.tolist(), RAYS[0], RAYS[1] - RAYS[0], *LIMITS, increment)


def test_a_navigator_corrects_anybodys_scan_that_has_a_time_increment(
    navigation: RobotNavigator,
) -> None:
    speed, rate, begin = 0.5, 1.5, 0.31
    increment = SWEEP / (len(RAYS) - 1)
    ranges = ranges_of(twisted(speed, rate, begin + increment * np.arange(len(RAYS))))
    taken: list[float] = []
    navigation.on_scan.append(lambda now, odometry: taken.append(now))
    for time in np.arange(0.0, 0.48, 0.01).tolist():
        pose = twisted(speed, rate, np.array([time]))[0]
        navigation.take_odometry(time, base_at(pose), ('odom', 'base'))
    navigation.senses.take_scan(begin, said(ranges, increment), 'base')
    assert not taken  # its last ray is of a time that odometry has not told of
    pose = twisted(speed, rate, np.array([0.5]))[0]
    navigation.take_odometry(0.5, base_at(pose), ('odom', 'base'))
    assert taken == [pytest.approx(begin + 0.5 * SWEEP)]
    scan, odometry = navigation.navigator.locator.seen  # type: ignore[union-attr]
    expected = twisted(speed, rate, np.array([begin + 0.5 * SWEEP]))[0]
    assert odometry == pytest.approx(expected, abs=1e-4)
    # Straight between two words of odometry: 1.5 rad/s for 10 ms is off by 3e-5 rad.
    assert off_walls(odometry, scan) < 1e-3


@pytest.mark.parametrize('increment', [-1e-4, math.nan, math.inf, 0.1])
def test_a_time_that_no_lidar_takes_is_said_and_the_scan_ignored(
    navigation: RobotNavigator, increment: float
) -> None:
    words: list[str] = []
    navigation.warn = words.append
    navigation.take_odometry(0.0, base_at(np.zeros(3)), ('odom', 'base'))
    navigation.take_odometry(1.0, base_at(np.zeros(3)), ('odom', 'base'))
    navigation.senses.take_scan(0.5, said(ranges_of(np.zeros((len(RAYS), 3))), increment), 'base')
    (word,) = words
    assert 'time_increment' in word and 'ignored' in word
    assert navigation.navigator.scans == 0


def test_a_lost_ray_frees_nothing_and_an_open_door_does() -> None:
    ranges = np.full(360, 3.0)
    ranges[[40, 90, 91]] = math.inf
    ranges[200:210] = math.inf
    scan = read_scan(ranges, RAYS, LIMITS)
    assert len(scan.ends) == 357
    assert (~scan.hits).sum() == 10


@pytest.mark.parametrize('lost', [[0], [359], [358, 359], [0, 1, 359]])
def test_a_ray_that_is_lost_at_the_ends_of_a_scan_frees_nothing(lost: list[int]) -> None:
    ranges = np.full(360, 3.0)
    ranges[lost] = math.inf
    scan = read_scan(ranges, RAYS, LIMITS)
    assert len(scan.ends) == 360 - len(lost) and scan.hits.all()


def test_the_map_of_a_lidar_that_turns_is_as_true_as_of_one_that_does_not() -> None:
    """Two circles in the room, 1.2 rad/s; without the correction walls are 20 cm off."""
    errors = []
    for corrected in (True, False):
        mapper, dt, worst = Mapper(), 1.0 / 5.5, 0.0
        random = np.random.default_rng(5)
        for index in range(60):
            times = index * dt + np.linspace(0.0, SWEEP, len(RAYS))
            poses = twisted(0.6, 1.2, times)
            middle = twisted(0.6, 1.2, np.array([times.mean()]))[0]
            moved = moves_between(middle, poses) if corrected else None
            ranges = ranges_of(poses) + 0.01 * random.normal(size=len(RAYS))
            scan = read_scan(ranges, RAYS, LIMITS, moved=moved)
            mapper.step(scan, middle, index * 1e-6 * np.eye(3))
            off = compose(inverse(middle), mapper.pose)
            worst = max(worst, math.hypot(off[0], off[1]))
        errors.append(worst)
    assert errors[0] < 0.01
    assert errors[1] > 2.0 * errors[0]
