# SPDX-License-Identifier: Apache-2.0
"""Who moves in scans is followed; who stands, and walls, are not; a robot stops in time."""

import math

from cases import for_all
import numpy as np
import pytest
from wasd_navigation.parameters import DriveLimits, Footprint, PlanningParameters
from wasd_navigation.planning.distances import Field
from wasd_navigation.planning.driver import Driver
from wasd_navigation.planning.motion import base_of, move
from wasd_navigation.planning.movers import group, Movers
from wasd_navigation.planning.sampling import is_safe, room_to_movers, Scene
from wasd_navigation.planning.surroundings import Surroundings
from wasd_navigation.records import Grid, Scan

PERIOD = 0.18  # of a slow lidar [s]
RAYS = np.linspace(-math.pi, math.pi, 360, endpoint=False)
NOBODY = np.zeros((0, 5))


def seen(place, half=0.2, noise=0.01, random=None):
    """Return what a lidar at the origin sees of a square that stands at a place, (n, 2)."""
    cos, sin = np.cos(RAYS), np.sin(RAYS)
    low, high = np.array(place) - half, np.array(place) + half
    with np.errstate(divide='ignore'):
        first = np.stack((low[0] / cos, low[1] / sin))
        last = np.stack((high[0] / cos, high[1] / sin))
    near = np.minimum(first, last).max(axis=0)
    far = np.maximum(first, last).min(axis=0)
    hit = (near <= far) & (near > 0.0)
    ranges = near[hit] + (0.0 if random is None else random.normal(0.0, noise, hit.sum()))
    return ranges[:, None] * np.stack((cos[hit], sin[hit]), axis=1)


def watch(place, velocity, seconds, random=None):
    """Let somebody walk; return who is known to move then, and where he is."""
    movers = Movers()
    at = np.array(place, float)
    for _ in range(round(seconds / PERIOD)):
        at = at + PERIOD * np.array(velocity)
        movers.step(PERIOD)
        movers.see(seen(at, random=random), np.zeros(2))
    return movers, at


@for_all('velocity', [(0.0, 0.6), (-1.0, 0.0), (0.5, 0.5), (0.0, -1.4)])
def test_a_walk_is_known_after_a_second(velocity):
    random = np.random.default_rng(3)
    movers, at = watch((3.5, 0.5), velocity, 1.1, random)
    (row,) = movers.now
    assert row[:2] == pytest.approx(at, abs=0.2)
    assert row[2:4] == pytest.approx(velocity, abs=0.25)
    assert 0.2 <= row[4] <= 0.4
    assert movers.are_about


@for_all('seed', range(20))
def test_who_stands_does_not_move(seed):
    random = np.random.default_rng(seed)
    movers, _ = watch(random.uniform(1.0, 3.5, 2), (0.0, 0.0), 5.0, random)
    assert len(movers.now) == 0
    assert not movers.are_about


def test_two_people_who_pass_each_other_are_two():
    movers = Movers()
    for tick in range(12):
        time = tick * PERIOD
        both = [seen((2.0 + 0.8 * time, 1.2)), seen((3.6 - 0.8 * time, 2.2))]
        points = np.concatenate(both)
        order = np.argsort(np.arctan2(points[:, 1], points[:, 0]))
        movers.step(PERIOD)
        movers.see(points[order], np.zeros(2))
    rows = movers.now
    assert len(rows) == 2
    assert sorted(np.sign(rows[:, 2])) == [-1.0, 1.0]


def test_who_is_not_seen_goes_on_for_a_moment_and_is_then_forgotten():
    movers, at = watch((3.0, -1.0), (0.0, 1.0), 1.4)
    movers.step(0.4)
    (row,) = movers.now
    assert row[:2] == pytest.approx(at + (0.0, 0.4), abs=0.25)
    movers.step(0.5)
    assert len(movers.now) == 0
    assert movers.are_about
    movers.step(30.0)
    assert not movers.are_about


def test_a_wall_is_nobody():
    ys = np.linspace(-2.0, 2.0, 80)
    wall = np.column_stack((np.full(80, 2.0), ys))
    assert group(wall, np.zeros(2)) == []


def test_a_group_goes_on_from_the_last_ray_to_the_first():
    points = seen((-2.0, 0.0))
    ((middle, radius),) = group(points, np.zeros(2))
    assert middle == pytest.approx((-2.0, 0.0), abs=0.12)
    assert radius < 0.4


def test_nothing_seen_is_nobody():
    assert group(np.zeros((0, 2)), np.zeros(2)) == []
    assert group(np.ones((1, 2)), np.zeros(2)) == []


def test_the_room_to_who_moves_is_in_closed_form():
    movers = np.array([[2.0, 0.0, -0.5, 0.0, 0.3]])
    state = np.zeros(6)
    circles = Footprint(radius=0.2).circles
    assert room_to_movers(movers, circles, state, 0.0) == pytest.approx(1.5)
    # He may have turned to one side.
    assert room_to_movers(movers, circles, state, 2.0) == pytest.approx(0.5 - 0.3)
    # Who stands has no line to leave.
    movers[0, 2] = 0.0
    assert room_to_movers(movers, circles, state, 2.0) == pytest.approx(1.5)
    assert room_to_movers(NOBODY, circles, state, 0.0) == math.inf


def scene(movers):
    nothing = Field(np.full((1, 40, 40), 5.0, np.float32), -10.0, -10.0, 0.5)
    circles = Footprint(radius=0.2).circles
    return Scene(nothing, nothing, circles, np.zeros((1, 3)), (0.02, 0.2), movers)


@for_all(
    ('movers', 'may_drive'),
    [
        (NOBODY, True),
        (np.array([[1.2, 0.0, 0.0, 0.0, 0.25]]), True),  # he stands, there is room to stop
        (np.array([[0.95, 0.0, 0.0, 0.0, 0.25]]), False),  # not if he steps towards it
        (np.array([[0.3, 0.7, 0.0, 0.0, 0.25]]), False),  # beside its way, too
        (np.array([[0.95, 0.0, -1.0, 0.0, 0.25]]), False),  # he comes
        (np.array([[0.95, 0.0, 1.0, 0.0, 0.25]]), True),  # he goes
        (np.array([[0.6, 0.75, 0.0, -1.0, 0.25]]), False),  # he crosses
        (np.array([[0.6, 2.5, 0.0, -1.0, 0.25]]), True),  # it stands before he is there
        (np.array([[0.3, 0.95, -0.8, -0.6, 0.25]]), False),  # he walks by, but may turn to it
        (np.array([[0.3, 0.95, -0.99, -0.1, 0.25]]), False),  # even by more than 60 degrees
        (np.array([[0.3, 1.2, -0.9, 0.4, 0.25]]), True),  # he would have to turn back
        (np.array([[0.3, 0.6, -0.9, 0.1, 0.25]]), False),  # so near he may
        (np.array([[-0.5, 0.0, -1.0, 0.0, 0.25]]), False),  # he has just gone by
        (np.array([[-0.5, 0.0, 0.0, 0.0, 0.25]]), True),  # he stands behind it
    ],
)
def test_a_robot_drives_only_where_it_can_stop_before_somebody_comes(movers, may_drive):
    # With all arguments, as the driver calls it: else it is compiled again, for 5 s.
    base = base_of(DriveLimits())
    state = np.array((0.0, 0.0, 0.0, 0.4, 0.0, 0.0))
    asked = np.array((0.4, 0.0, 0.0))
    assert is_safe(state, asked, scene(movers), base, 0.15, False) == may_drive
    assert is_safe(0.0 * state, np.zeros(3), scene(movers), base, 0.0, False)


def test_a_robot_that_is_slow_passes_who_stands():
    base = base_of(DriveLimits())
    state = np.array((0.0, 0.0, 0.0, 0.1, 0.0, 0.0))
    stands = scene(np.array([[0.3, 0.6, 0.0, 0.0, 0.25]]))
    before = scene(np.array([[0.48, 0.0, 0.0, 0.0, 0.25]]))
    asked = np.array((0.1, 0.0, 0.0))
    assert not is_safe(state, asked, stands, base, 0.15, False)
    assert is_safe(state, asked, stands, base, 0.15, True)
    assert not is_safe(state, 4.0 * asked, before, base, 0.15, True)


def test_who_has_walked_up_to_the_robot_and_is_not_seen_is_still_there():
    """A lidar does not see who stands against it: the robot moved while he walked over it."""
    movers, at = watch((1.6, 0.0), (-1.0, 0.0), 1.1)
    assert np.hypot(*at) < 0.55
    movers.step(0.3)
    (row,) = movers.now
    assert row[:2] == pytest.approx(at, abs=0.2)


def test_who_appears_near_is_taken_to_come_until_he_is_known():
    movers = Movers()
    movers.step(PERIOD)
    movers.see(seen((1.2, 0.0)), np.zeros(2))
    (row,) = movers.now
    assert row[2:4] == pytest.approx((-1.0, 0.0), abs=0.05)
    for _ in range(4):
        movers.step(PERIOD)
        movers.see(seen((1.2, 0.0)), np.zeros(2))
    assert len(movers.now) == 0
    assert not movers.are_about


@for_all('shown', [0.25, 0.5, 0.75])
def test_who_comes_into_view_bit_by_bit_and_walks_off_is_never_taken_to_stand(shown):
    # What is seen of him grows to the right while he goes to the left.
    movers = Movers()
    place = np.array((1.2, 0.0))
    for tick in range(10):
        points = seen(place)
        movers.step(PERIOD)
        movers.see(points[int(len(points) * (1.0 - shown)) :] if tick < 2 else points, np.zeros(2))
        assert len(movers.now) == 1
        place = place + (0.0, 0.6 * PERIOD)


def test_a_walk_is_known_by_the_second_scan_also_back_to_where_he_was_seen_first():
    movers = Movers()
    movers.see(seen((1.8, 0.25)), np.zeros(2))
    for tick in range(13):
        movers.step(PERIOD)
        movers.see(seen((1.8, max(tick - 10, 0) * 0.6 * PERIOD)), np.zeros(2))
        if tick != 11 and tick > 6:
            assert len(movers.now) == (tick == 12)


def test_who_has_stopped_may_walk_on_for_ten_seconds():
    movers, at = watch((3.0, -1.0), (0.0, 1.0), 1.4)
    for tick in range(round(12.0 / PERIOD)):
        movers.step(PERIOD)
        movers.see(seen(at), np.zeros(2))
        if 1.5 < tick * PERIOD < 9.0:
            (row,) = movers.now
            assert row[:2] == pytest.approx(at, abs=0.1)
            assert row[2:4] == pytest.approx((0.0, 0.0), abs=0.1)
    assert len(movers.now) == 0


def test_who_has_stopped_is_seen_also_where_the_map_has_taken_him_in():
    hall = Hall(*WHEELS, ((3.0, 1.0), (3.0, 3.0)), 1.0)
    around = Surroundings(hall.footprint, PlanningParameters())
    around.take_map(hall.grid, 0, hall.state[:2])
    for tick in range(20):
        place = np.array((3.0, min(1.0 + tick * PERIOD, 3.0)))
        if tick == 13:
            hall.grid.cells[56:64, 56:64] = 100
            around.take_map(hall.grid, 1, hall.state[:2])
        around.movers.step(PERIOD)
        around.see(hall.look(place), hall.state[:3])
    (row,) = around.movers.now
    assert row[:2] == pytest.approx(place, abs=0.1)


def test_hits_that_were_added_to_a_scan_are_none_of_the_lidar():
    hits = Scan(np.zeros(2), seen((2.0, 0.0)), np.ones(len(seen((2.0, 0.0))), bool))
    more = hits.with_hits(np.array([[0.5, 0.5], [0.6, 0.5]])).seen_from(np.array([1.0, 0.0, 0.0]))
    assert more.own_points == pytest.approx(seen((2.0, 0.0)) + (1.0, 0.0))
    assert len(more.points) == len(more.own_points) + 2


class Hall:
    """A robot in an empty hall of 8 x 6 m; a person walks along a line, stays, and is gone."""

    def __init__(self, limits, footprint, line, speed, stays=0.0):
        cells = np.zeros((120, 160), np.int8)
        cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = 100
        self.grid = Grid(cells, 0.05, (0.0, 0.0))
        self.driver, self.base = Driver(limits, footprint), base_of(limits)
        self.state = np.array((1.0, 3.0, 0.0, 0.0, 0.0, 0.0))
        self.footprint = footprint
        self.begin, end = map(np.array, line)
        self.along = (end - self.begin) / math.dist(end, self.begin)
        self.length, self.speed = math.dist(end, self.begin), speed
        self.until, self.time, self.scanned = self.length / speed + stays, 0.0, -1.0
        self.touches, self.is_touching = 0, False
        self.random = np.random.default_rng(5)

    def run(self, seconds):
        for _ in range(round(seconds / 0.05)):
            place = self.begin + min(self.speed * self.time, self.length) * self.along
            is_here = self.time < self.until
            scan = None
            if self.time - self.scanned >= PERIOD:
                self.scanned = self.time
                scan = self.look(place if is_here else np.array((50.0, 50.0)))
            pose, velocity = self.state[:3].copy(), self.state[3:].copy()
            asked = self.driver.step(self.grid, 0, pose, velocity, scan, 0.05)
            move(self.state, asked, self.base, 0.05)
            self.time += 0.05
            if is_here:
                self.count(place)
            if not self.driver.is_under_way:
                break
        return self.driver.state

    def look(self, place):
        cos, sin = math.cos(self.state[2]), math.sin(self.state[2])
        turn = np.array(((cos, -sin), (sin, cos)))
        hit = seen(place - self.state[:2], random=self.random)
        # What is not in the shadow of the person is seen to be free.
        angles = np.arctan2(hit[:, 1], hit[:, 0])
        free = RAYS[~np.any(np.abs(angles - RAYS[:, None]) < 0.01, axis=1)]
        away = 8.0 * np.stack((np.cos(free), np.sin(free)), axis=1)
        points = np.concatenate((hit, away)) @ turn
        hits = np.arange(len(points)) < len(hit)
        order = np.argsort(np.arctan2(points[:, 1], points[:, 0]))
        return Scan(np.zeros(2), points[order], hits[order])

    def count(self, place):
        """Count each first touch of the person, 40 cm wide, by a robot that moves."""
        is_touching = False
        cos, sin = math.cos(self.state[2]), math.sin(self.state[2])
        for x, y, radius in self.footprint.circles:
            at = self.state[:2] + (cos * x - sin * y, sin * x + cos * y)
            apart = np.maximum(np.abs(place - at) - 0.2, 0.0)
            is_touching |= bool(np.hypot(*apart) < radius)
        moves = np.hypot(*self.state[3:5]) > 0.03 or abs(self.state[5]) > 0.1
        self.touches += bool(is_touching and not self.is_touching and moves)
        self.is_touching = is_touching


WHEELS = DriveLimits(), Footprint(radius=0.2)
LEGS = (
    DriveLimits(forward=0.4, backward=0.3, lateral=0.3, yaw=0.5, lag=0.3),
    Footprint(half_length=0.34, half_width=0.164),
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ('robot', 'line', 'speed'),
    [
        (WHEELS, ((3.0, 0.5), (3.0, 5.5)), 0.6),
        (WHEELS, ((6.8, 3.0), (0.5, 3.0)), 1.0),
        (WHEELS, ((6.5, 4.5), (1.0, 2.5)), 1.0),
        (LEGS, ((3.4, 5.5), (3.4, 0.5)), 0.6),
        (LEGS, ((6.8, 3.0), (0.5, 3.0)), 1.0),
    ],
)
def test_a_robot_that_moves_touches_nobody_who_walks_on(robot, line, speed):
    hall = Hall(*robot, line, speed)
    hall.driver.set_goal(np.array((6.5, 3.0, 0.0)))
    assert hall.run(60.0) == 'arrived'
    assert hall.touches == 0


@pytest.mark.slow
def test_a_robot_waits_for_somebody_who_has_just_come_to_stand_in_a_door():
    hall = Hall(*WHEELS, ((3.0, 1.0), (4.0, 3.0)), 0.8, stays=6.0)
    hall.grid.cells[:, 79:82] = 100
    hall.grid.cells[52:68, 79:82] = 0  # a door of 0.8 m
    hall.driver.set_goal(np.array((2.0, 3.0, 0.0)))
    hall.run(3.0)
    hall.driver.set_goal(np.array((6.5, 3.0, 0.0)))
    hall.run(0.5)
    assert hall.driver.reason.endswith(': waiting')
    assert hall.run(60.0) == 'arrived'
    assert hall.touches == 0
