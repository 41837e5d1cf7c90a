# SPDX-License-Identifier: Apache-2.0
"""Mapping: scans are matched, loops closed, a grid drawn; in a room of four walls and a box."""

from lidar_room import BOX, circle, look, ROOM
import numpy as np
import pytest
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.se2 import compose, inverse


def drive(mapper: Mapper, poses: np.ndarray, scale: float) -> np.ndarray:
    """Have a mapper see what is seen from true poses, with an odometry that is off by a scale."""
    random = np.random.default_rng(0)
    odometry, covariance, seen = poses[0], np.zeros((3, 3)), []
    for index, pose in enumerate(poses):
        if index:
            move = compose(inverse(poses[index - 1]), pose)
            odometry = compose(odometry, move * scale)
            covariance = covariance + np.diag((1e-5, 1e-5, 1e-5))
        mapper.step(look(pose, random), odometry, covariance)
        seen.append(mapper.pose.copy())
    return np.array(seen)


@pytest.fixture(scope='module')
def driven() -> tuple[Mapper, np.ndarray]:
    mapper = Mapper()
    return mapper, drive(mapper, circle(120), 1.05)


@pytest.fixture
def mapper(driven: tuple[Mapper, np.ndarray]) -> Mapper:
    return driven[0]


def test_a_pose_is_known_however_odometry_drifts(driven: tuple[Mapper, np.ndarray]) -> None:
    mapper, seen = driven
    away = np.hypot(*(seen - circle(120))[:, :2].T)
    assert away.max() < 0.02
    assert mapper.closures > 0


def test_the_grid_is_occupied_where_walls_are(mapper: Mapper) -> None:
    grid = mapper.grid
    occupied = grid.to_points(np.argwhere(grid.cells == 100))
    walls = [np.abs(occupied[:, axis] - ROOM[axis + side]) for axis in (0, 1) for side in (0, 2)]
    low, high = np.array(BOX[:2]) - occupied, occupied - np.array(BOX[2:])
    outside = np.maximum(low, high)
    box = np.abs(outside.max(axis=1))
    assert np.min([*walls, box], axis=0).max() < 0.08
    free = grid.to_points(np.argwhere(grid.cells == 0))
    inside = np.maximum(np.array(BOX[:2]) - free, free - np.array(BOX[2:])).max(axis=1)
    assert (inside > -0.03).all()
    assert len(free) * grid.resolution**2 == pytest.approx(5.5 * 4.5 - 0.7 * 0.8, rel=0.1)


def test_the_same_scans_give_the_same_bytes() -> None:
    grids = []
    mapper = Mapper()
    for _ in range(2):
        drive(mapper, circle(40), 1.02)
        grids.append((mapper.grid.cells.tobytes(), mapper.pose.tobytes()))
        mapper.reset()
    assert grids[0] == grids[1]


def test_correction_takes_odometry_to_the_map() -> None:
    mapper = Mapper()
    poses = circle(30)
    drive(mapper, poses, 1.0)
    assert compose(mapper.correction, poses[-1]) == pytest.approx(mapper.pose, abs=1e-9)
    assert mapper.correction == pytest.approx(np.zeros(3), abs=0.01)


def test_a_map_begins_where_odometry_is() -> None:
    mapper = Mapper()
    begin = np.array((3.0, -1.0, 2.0))
    mapper.step(look(np.zeros(3), np.random.default_rng(0)), begin, np.zeros((3, 3)))
    assert mapper.pose == pytest.approx(begin)
    assert mapper.correction == pytest.approx(np.zeros(3), abs=1e-12)


def test_a_robot_that_has_slipped_is_found_again() -> None:
    mapper, random, poses = Mapper(), np.random.default_rng(5), circle(120)
    slip = np.array((0.5, 0.3, 0.4))
    for index, pose in enumerate(poses[:100]):
        odometry = pose if index < 60 else compose(slip, pose)
        mapper.step(look(pose, random), odometry, index * 1e-5 * np.eye(3))
    assert np.hypot(*(mapper.pose - poses[99])[:2]) < 0.02
    occupied = mapper.grid.to_points(np.argwhere(mapper.grid.cells == 100))
    assert (occupied > np.array(ROOM[:2]) - 0.1).all()
    assert (occupied < np.array(ROOM[2:]) + 0.1).all()


def test_odometry_that_is_set_anew_leaves_map_and_robot_where_they_are() -> None:
    mapper, random, poses = Mapper(), np.random.default_rng(6), circle(120)
    zero = inverse(poses[50])
    for index, pose in enumerate(poses[:70]):
        odometry = pose if index < 50 else compose(zero, pose)
        if index == 50:
            mapper.take_leap(poses[49], odometry)
        mapper.step(look(pose, random), odometry, index * 1e-5 * np.eye(3))
        # With it a step of the robot is lost, which the scan tells.
        assert np.hypot(*(mapper.pose - pose)[:2]) < 0.03
    assert compose(mapper.correction, odometry) == pytest.approx(mapper.pose)


def test_a_robot_that_is_carried_away_says_so_draws_nothing_and_finds_itself_again() -> None:
    mapper, random, poses = Mapper(), np.random.default_rng(7), circle(120)
    for index, pose in enumerate(poses[:60]):
        mapper.step(look(pose, random), pose, index * 1e-5 * np.eye(3))
    known, before = len(mapper.places), mapper.grid.cells.copy()
    # To the other end of the room, turned; odometry has not seen it.
    there = np.array((2.2, -1.2, poses[59][2] + 2.4))
    said = []
    for index in range(60):
        mapper.step(look(there, random), poses[59], (60 + index) * 1e-5 * np.eye(3))
        said.append(mapper.notice)
        if not mapper.is_found:
            assert len(mapper.places) == known
            np.testing.assert_array_equal(mapper.grid.cells, before)
    told = [index for index, words in enumerate(said) if 'moved by hand' in words]
    assert told and told[0] <= 11  # two seconds of 5.5 scans
    assert mapper.is_found and mapper.notice == ''
    assert np.hypot(*(mapper.pose - there)[:2]) < 0.03
    for index in range(40):  # it drives on, and the map stays true
        pose = compose(there, np.array((0.0, 0.0, 0.1 * index)))
        odometry = compose(poses[59], np.array((0.0, 0.0, 0.1 * index)))
        mapper.step(look(pose, random), odometry, (120 + index) * 1e-5 * np.eye(3))
    assert np.hypot(*(mapper.pose - pose)[:2]) < 0.03
    occupied = mapper.grid.to_points(np.argwhere(mapper.grid.cells == 100))
    assert (occupied > np.array(ROOM[:2]) - 0.1).all()
    assert (occupied < np.array(ROOM[2:]) + 0.1).all()


def test_a_robot_that_is_put_back_does_not_draw_its_room_again_behind_the_walls() -> None:
    mapper, random = Mapper(), np.random.default_rng(11)
    start = np.array((-1.2, -1.0, 0.0))
    for index in range(60):
        pose = start + np.array((0.0, 1.5 * min(index / 29, 1.0), 0.0))
        # Odometry has not seen that it was put back.
        seen = look(pose if index < 30 else start, random)
        mapper.step(seen, pose, index * 1e-5 * np.eye(3))
    assert np.hypot(*(mapper.pose - start)[:2]) < 0.03
    occupied = mapper.grid.to_points(np.argwhere(mapper.grid.cells == 100))
    assert (occupied < np.array(ROOM[2:]) + 0.1).all()


def test_a_robot_whose_wheels_spin_says_that_it_is_stuck_and_stays_where_it_is() -> None:
    """It drives at 0.3 m/s and meets a sill; three seconds are 16 scans."""
    mapper, random, said = Mapper(), np.random.default_rng(8), []
    for index in range(50):
        x = -1.0 + 0.3 / 5.5 * index
        pose = np.array((min(x, 0.2), 0.0, 0.0))
        odometry = np.array((x, 0.0, 0.0))
        mapper.step(look(pose, random), odometry, index * 1e-5 * np.eye(3))
        if x > 0.2:
            said.append(mapper.is_stuck and mapper.notice.startswith('stuck'))
        else:
            assert mapper.notice == ''
        assert np.hypot(*(mapper.pose - pose)[:2]) < 0.05
    assert said.index(True) <= 16


def test_who_left_is_unlearnt_by_a_robot_that_stands() -> None:
    """Somebody stood before the box's wall for a while; the robot has not moved since."""
    mapper, random = Mapper(), np.random.default_rng(9)
    pose = np.zeros(3)
    for index in range(60):
        scan = look(pose, random, with_box=index < 30)
        mapper.step(scan, pose, index * 1e-6 * np.eye(3))
        if index == 29:
            inside = mapper.grid.to_cells(np.array(((BOX[0] + 0.02, 1.3),)))[0]
            assert mapper.grid.cells[tuple(inside)] == 100
    assert mapper.grid.cells[tuple(inside)] == 0


def test_places_do_not_become_more_where_it_has_been_often() -> None:
    """Ten rounds of the same circle; what is drawn, and remembered, is that of the first few."""
    mapper, random = Mapper(), np.random.default_rng(10)
    poses, counts = circle(80)[:40], []
    odometry, covariance, before = poses[0], np.zeros((3, 3)), poses[0]
    for _ in range(10):
        for pose in poses:
            odometry = compose(odometry, compose(inverse(before), pose) * 1.02)
            covariance = covariance + 1e-5 * np.eye(3)
            mapper.step(look(pose, random), odometry, covariance)
            before = pose
        counts.append(len(mapper.places))
        assert np.hypot(*(mapper.pose - before)[:2]) < 0.02
    assert counts[9] - counts[5] <= 2


def test_who_turns_where_it_has_been_often_adds_few_places() -> None:
    """Back and forth on 1.2 m, then six turns: after two of them nothing new is seen."""
    mapper, random = Mapper(), np.random.default_rng(11)
    start, counts = circle(80)[0], []
    forth = [compose(start, np.array((way, 0.0, 0.0))) for way in np.linspace(0.0, 1.2, 25)]
    turns = [start + (0.0, 0.0, np.pi * (index + 1) / 10.0) for index in range(20)]
    for way in [forth, forth[::-1]] * 10 + [turns] * 6:
        for pose in way:
            mapper.step(look(pose, random), pose, len(counts) * 1e-6 * np.eye(3))
            counts.append(len(mapper.places))
    assert counts[-1] - counts[-81] <= 10
    assert np.hypot(*(mapper.pose - pose)[:2]) < 0.01


def test_a_map_holds_no_more_when_the_robot_drives_on_where_all_is_known(monkeypatch) -> None:
    """Circles beside each other, each at other places: what is kept of them is limited."""
    monkeypatch.setattr('wasd_navigation.mapping.mapper.MOST_OF_FEW', 30)
    monkeypatch.setattr('wasd_navigation.mapping.mapper.MOST_PLACES', 1.0)
    monkeypatch.setattr('wasd_navigation.mapping.mapper.MANY', 1000)
    mapper, random, held, count = Mapper(), np.random.default_rng(12), [], 0
    for turn in range(12):
        off = 0.25 * np.array((np.cos(turn), np.sin(turn), 0.0))
        for pose in circle(80)[:40] + off:
            count += 1
            mapper.step(look(pose, random), pose, count * 1e-6 * np.eye(3))
            assert np.hypot(*(mapper.pose - pose)[:2]) < 0.02
        held.append(len(mapper.session.scans))
    assert len(mapper.places) > 80
    # Those that scans are matched against, the last 25, are not merged.
    assert max(held) <= 30 + 25
    assert held[-1] <= held[6]
