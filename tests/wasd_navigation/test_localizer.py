# SPDX-License-Identifier: Apache-2.0
"""Localising in a map: from near, from nowhere, after a hand has moved the robot."""

import math

from cases import for_all
from lidar_room import circle, look
import numpy as np
import pytest
from wasd_navigation.mapping.local_map import Fit
from wasd_navigation.mapping.localizer import Hypotheses, Localizer
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.mapping.search import Found
from wasd_navigation.records import Grid, Scan, UNKNOWN
from wasd_navigation.se2 import compose, inverse, wrap

# Odometry begins somewhere else than the map.
ODOM = np.array((4.0, 1.0, -2.0))
SCANS_OF_2_S = 11


def map_room(with_box: bool) -> Grid:
    """Return the grid of the room as it is mapped."""
    mapper, random = Mapper(), np.random.default_rng(1)
    for pose in circle(60):
        mapper.step(look(pose, random, with_box), pose, np.zeros((3, 3)))
    return mapper.grid


def is_near(pose: np.ndarray, true: np.ndarray, distance: float = 0.02) -> bool:
    """Whether a pose is within a distance [m], and a degree, of the true one."""
    away = math.hypot(pose[0] - true[0], pose[1] - true[1])
    return away <= distance and abs(wrap(pose[2] - true[2])) < math.radians(1.0)


class Robot:
    """A robot at a pose in the room, with a localizer that its lidar and odometry tell."""

    def __init__(self, grid: Grid, pose: np.ndarray, with_box: bool = True) -> None:
        self.localizer = Localizer(grid)
        self.pose, self._odometry = pose, ODOM
        self._random = np.random.default_rng(3)
        self._covariance = np.zeros((3, 3))
        self._with_box = with_box

    def go(self, pose: np.ndarray, hidden: float = 0.0) -> None:
        """Drive to a pose and look; somebody near hides a share of what is seen."""
        self._odometry = compose(self._odometry, compose(inverse(self.pose), pose))
        self.pose = pose
        self._covariance = self._covariance + np.diag((1e-5, 1e-5, 1e-5))
        scan = look(pose, self._random, self._with_box)
        ends = scan.ends.copy()
        near = ends[: round(hidden * len(ends))]
        near *= 0.4 / np.hypot(*near.T)[:, None]
        seen = Scan(scan.origin, ends, scan.hits)
        self.localizer.step(seen, self._odometry, self._covariance)


@pytest.fixture(scope='module')
def grid() -> Grid:
    return map_room(with_box=True)


@pytest.mark.slow
@pytest.mark.parametrize('angle', np.linspace(0.0, 2.0 * math.pi, 4, endpoint=False))
def test_half_a_metre_and_30_degrees_off_is_put_right_in_3_s(grid: Grid, angle: float) -> None:
    poses = circle(240)[30:47]
    robot = Robot(grid, poses[0])
    off = (0.5 * math.cos(angle), 0.5 * math.sin(angle), math.radians(30.0))
    robot.localizer.start(poses[0] + off, np.diag((0.25, 0.25, 0.07)))
    assert not robot.localizer.is_found
    for pose in poses:
        robot.go(pose)
    assert robot.localizer.is_found
    assert is_near(robot.localizer.pose, poses[-1])
    taken_back = compose(robot.localizer.correction, robot._odometry)
    assert taken_back == pytest.approx(robot.localizer.pose, abs=1e-9)


@pytest.mark.slow
def test_without_a_word_the_whole_map_is_searched(grid: Grid) -> None:
    poses = circle(240)[100:160]
    robot = Robot(grid, poses[0])
    for pose in poses:
        robot.go(pose)
    assert robot.localizer.is_found
    assert is_near(robot.localizer.pose, poses[-1])
    assert robot.localizer.covariance[0, 0] < 0.02**2


def test_a_robot_that_was_moved_says_so_and_is_found_again(grid: Grid) -> None:
    poses = circle(240)
    robot = Robot(grid, poses[0])
    robot.localizer.start(poses[0], np.diag((0.01, 0.01, 0.01)))
    for pose in poses[:20]:
        robot.go(pose)
    assert robot.localizer.is_found and robot.localizer.notice is None
    robot.pose = np.array((-1.2, -0.9, 2.5))  # by hand: odometry does not know
    said = None
    for _ in range(SCANS_OF_2_S):
        robot.go(robot.pose)
        said = said or robot.localizer.notice
    assert said is not None and said.startswith('was moved by hand')
    for _ in range(60):
        robot.go(compose(robot.pose, np.array((0.01, 0.0, 0.01))))
    assert robot.localizer.is_found and robot.localizer.notice is None
    assert is_near(robot.localizer.pose, robot.pose)


def test_a_robot_that_was_moved_to_where_much_looks_the_same_says_so_and_is_found(
    grid: Grid,
) -> None:
    poses = circle(240)[90:110]  # to where the box is near
    robot = Robot(grid, poses[0])
    robot.localizer.start(poses[0], np.diag((0.01, 0.01, 0.01)))
    for pose in poses:
        robot.go(pose)
    assert robot.localizer.is_found
    # By hand to the other side of the middle: walls are where they were, the box is not.
    robot.pose = compose(np.array((0.5, 0.5, math.pi)), robot.pose)
    said = ''
    for _ in range(SCANS_OF_2_S):
        robot.go(robot.pose)
        said += robot.localizer.notice or ''
    assert 'may have been moved by hand: ' in said
    for _ in range(120):
        robot.go(compose(robot.pose, np.array((0.005, 0.0, 0.01))))
    assert robot.localizer.is_found and robot.localizer.notice is None
    assert is_near(robot.localizer.pose, robot.pose)


@pytest.mark.parametrize('hand', [(0.4, -0.3, 0.0), (-0.4, 0.3, 0.0)])
def test_a_robot_that_was_moved_a_little_says_so_and_goes_on_from_there(
    grid: Grid, hand: tuple[float, float, float]
) -> None:
    poses = circle(240)
    robot = Robot(grid, poses[0])
    robot.localizer.start(poses[0], np.diag((0.01, 0.01, 0.01)))
    for pose in poses[:20]:
        robot.go(pose)
    robot.pose = compose(robot.pose, np.array(hand))
    said = []
    for _ in range(2 * SCANS_OF_2_S):
        robot.go(robot.pose)
        said.append(robot.localizer.notice or '')
        assert robot.localizer.is_found
    assert any('was moved by hand, by 0.50 m' in words for words in said[:SCANS_OF_2_S])
    assert not said[-1]
    assert is_near(robot.localizer.pose, robot.pose)


def test_a_robot_that_was_moved_is_not_near_where_the_map_contradicts_that(grid: Grid) -> None:
    poses = circle(240)[90:110]
    robot = Robot(grid, poses[0])
    robot.localizer.start(poses[0], np.diag((0.01, 0.01, 0.01)))
    for pose in poses:
        robot.go(pose)
    # To the other side of the middle, and half a metre on: the walls fit there, the box does not.
    robot.pose = compose(np.array((0.5, 0.5, math.pi)), robot.pose)
    robot.pose = compose(robot.pose, np.array((0.4, 0.3, 0.2)))
    said = ''
    for _ in range(SCANS_OF_2_S):
        robot.go(robot.pose)
        said += robot.localizer.notice or ''
    assert 'moved by hand' in said and 'goes on' not in said
    for _ in range(30):
        robot.go(compose(robot.pose, np.array((0.005, 0.0, 0.01))))
    assert robot.localizer.is_found
    assert is_near(robot.localizer.pose, robot.pose)


def test_somebody_who_stands_before_the_lidar_does_not_make_it_lose_its_place(grid: Grid) -> None:
    poses = circle(240)
    robot = Robot(grid, poses[0])
    robot.localizer.start(poses[0], np.diag((0.01, 0.01, 0.01)))
    for pose in poses[:20]:
        robot.go(pose)
    said = []
    for pose in poses[20:120]:
        robot.go(pose, hidden=0.3)
        said.append(robot.localizer.notice)
        assert robot.localizer.is_found
        assert is_near(robot.localizer.pose, pose, 0.04)
    assert any(said) and said[-1] is None


def test_a_robot_that_looks_at_what_is_not_in_the_map_was_not_moved(grid: Grid) -> None:
    cells, poses = grid.cells.copy(), circle(240)
    cells[: round(0.58 * len(cells))] = UNKNOWN
    robot = Robot(Grid(cells, grid.resolution, grid.origin), poses[0])
    # It was sure of its place before it came to look there.
    robot.localizer._tracker.put(poses[0], 1e-4 * np.eye(3))
    robot.localizer._hypotheses, robot.localizer._usual = None, 0.9
    shares = []
    fit = robot.localizer._tracker.fit
    for pose in poses[:60]:
        robot.localizer._tracker.fit = lambda *all_: shares.append(fit(*all_)) or shares[-1]
        robot.go(pose)
        assert robot.localizer.is_found
        assert is_near(robot.localizer.pose, pose, 0.05)
    assert np.mean([each.share < 0.55 for each in shares]) > 0.5


def test_what_is_ambiguous_is_said_to_be_and_not_decided() -> None:
    robot = Robot(map_room(with_box=False), np.array((1.0, 0.5, 0.3)), with_box=False)
    for _ in range(60):
        robot.go(compose(robot.pose, np.array((0.005, 0.0, 0.01))))
    assert not robot.localizer.is_found
    assert robot.localizer.notice == 'may be at 2 places: drive on to tell them apart'


@for_all(('contradicted', 'is_decided'), [(0.05, True), (0.28, False)])
def test_a_last_place_that_the_map_contradicts_is_none(
    contradicted: float, is_decided: bool
) -> None:
    """Of three in an office of table legs none was right, and the last was not either."""
    places = Hypotheses()
    poses = np.array(((0.0, 0.0, 0.0), (3.0, 0.0, 0.0)))
    places.take(Found(poses, np.full(2, 0.9)), np.zeros(3))
    fit = {0.0: contradicted, 3.0: contradicted + 0.1}
    ever = False
    for _ in range(20):
        places.judge(lambda pose: Fit(pose, np.eye(3), 0.7), lambda pose: fit[pose[0]])
        ever |= len(places) > 0 and places.is_decided(was_told=False)
    assert ever == is_decided
    assert len(places) == is_decided


def test_places_that_no_longer_fit_are_no_longer_told() -> None:
    robot = Robot(map_room(with_box=False), np.array((1.0, 0.5, 0.3)), with_box=False)
    for _ in range(60):
        robot.go(compose(robot.pose, np.array((0.005, 0.0, 0.01))))
    assert robot.localizer.notice
    for _ in range(60):
        robot.go(robot.pose, hidden=1.0)
    assert not robot.localizer.is_found
    assert robot.localizer.notice is None


def test_odometry_that_is_no_number_changes_nothing(grid: Grid) -> None:
    localizer = Localizer(grid)
    scan = look(np.zeros(3), np.random.default_rng(0))
    localizer.step(scan, np.array((math.nan, 0.0, 0.0)), np.zeros((3, 3)))
    assert localizer.pose == pytest.approx(np.zeros(3))


def test_odometry_that_is_set_anew_leaves_the_robot_where_it_is(grid: Grid) -> None:
    poses = circle(60)
    robot = Robot(grid, poses[0])
    robot.localizer.start(poses[0], 1e-4 * np.eye(3))
    for index, pose in enumerate(poses[:40]):
        if index == 30:
            robot.localizer.take_leap(robot._odometry, np.zeros(3))
            robot._odometry = np.zeros(3)
        robot.go(pose)
    assert robot.localizer.is_found
    assert is_near(robot.localizer.pose, poses[39])


@pytest.mark.slow
@pytest.mark.parametrize('angle', np.linspace(0.3, 2.0 * math.pi, 5, endpoint=False))
def test_a_push_is_found_out_and_it_does_not_get_lost(grid: Grid, angle: float) -> None:
    poses = circle(240)
    robot = Robot(grid, poses[40])
    robot.localizer.start(poses[40], np.diag((0.01, 0.01, 0.01)))
    for pose in poses[40:60]:
        robot.go(pose)
    assert robot.localizer.is_found
    push = np.array((0.18 * math.cos(angle), 0.18 * math.sin(angle), 0.1))
    robot.pose = compose(robot.pose, inverse(push))  # which odometry does not see
    for pose in poses[60:76]:
        robot.go(pose)
        assert robot.localizer.is_found
    assert is_near(robot.localizer.pose, poses[75])


def test_a_robot_whose_wheels_spin_says_that_it_is_stuck_until_it_backs_off(grid: Grid) -> None:
    """It drives at 0.3 m/s and meets a sill; three seconds are 16 scans."""
    robot, said = Robot(grid, np.array((-1.0, 0.0, 0.0))), []
    step = np.array((0.3 / 5.5, 0.0, 0.0))
    robot.localizer.start(robot.pose, 1e-4 * np.eye(3))
    for _ in range(20):
        robot.go(compose(robot.pose, step))
        assert robot.localizer.notice is None
    for _ in range(30):
        robot._odometry = compose(robot._odometry, step)  # which the robot does not do
        robot.go(robot.pose)
        said.append(robot.localizer.is_stuck and 'stuck' in robot.localizer.notice)
        assert is_near(robot.localizer.pose, robot.pose, 0.05)
    assert said.index(True) <= 16
    assert said[-1]
    for _ in range(16):
        robot.go(compose(robot.pose, -step))
    assert robot.localizer.notice is None
    assert is_near(robot.localizer.pose, robot.pose)
