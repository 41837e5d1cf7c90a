# SPDX-License-Identifier: Apache-2.0
"""Driving to a goal: a base that does what it is told, in a room of cells, seen by rays."""

from collections.abc import Callable
import math
from typing import Any

import numpy as np
import pytest
from wasd_navigation.parameters import DriveLimits, Footprint, PlanningParameters
from wasd_navigation.planning import heading_field, route
from wasd_navigation.planning.driver import Driver
from wasd_navigation.planning.heading_field import HeadingField, set_price, spread
from wasd_navigation.planning.motion import base_of, move
from wasd_navigation.planning.route import AT_ONCE, SLICE
from wasd_navigation.planning.surroundings import Surroundings
from wasd_navigation.records import Grid, Scan

# Each drives a robot for a while.
pytestmark = pytest.mark.slow

DT = 0.05
ROUND = Footprint(radius=0.2)
LONG = Footprint(half_length=0.35, half_width=0.155)
WHEELS = DriveLimits()
LEGS = DriveLimits(forward=0.4, backward=0.3, lateral=0.3, yaw=0.5, lag=0.3)
LEG_PLANNING = PlanningParameters(xy_goal_tolerance=0.10, yaw_goal_tolerance=math.radians(5.0))
NOTHING = Scan(np.zeros(2), np.zeros((0, 2)), np.zeros(0, bool))


def room(*walls: tuple[float, float, float, float]) -> Grid:
    """Return a room of 6 x 4 m, the origin in a corner, with walls (x, y, x, y) in it."""
    cells = np.zeros((80, 120), np.int8)
    cells[0] = cells[-1] = 100
    cells[:, 0] = cells[:, -1] = 100
    for x, y, to_x, to_y in walls:
        rows, columns = (
            slice(round(a / 0.05), round(b / 0.05)) for a, b in ((y, to_y), (x, to_x))
        )
        cells[rows, columns] = 100
    return Grid(cells, 0.05, (0.0, 0.0))


# A wall across the room, with a door of 0.8 m.
PARTED = room((2.9, 0.0, 3.05, 2.4), (2.9, 3.2, 3.05, 4.0))


class Drive:
    """A robot with a driver in a room; `look` gives it a scan, by its pose."""

    def __init__(
        self, driver: Driver, limits: DriveLimits, grid: Grid, pose: tuple[float, float, float]
    ) -> None:
        self.driver, self.grid, self.revision = driver, grid, 0
        self.base = base_of(limits)
        self.state = np.array((*pose, 0.0, 0.0, 0.0))
        self.asked = np.zeros(3)
        self.places = [self.state.copy()]
        self.look: Callable[[np.ndarray], Scan | None] = lambda pose: NOTHING

    def run(self, seconds: float) -> str:
        """Go on for a time, or until the driver is through; return its state."""
        for _ in range(round(seconds / DT)):
            pose, velocity = self.state[:3].copy(), self.state[3:].copy()
            scan = self.look(pose)
            self.asked = self.driver.step(self.grid, self.revision, pose, velocity, scan, DT)
            move(self.state, self.asked, self.base, DT)
            self.places.append(self.state.copy())
            if not self.driver.is_under_way:
                break
        return self.driver.state

    def off(self, goal: np.ndarray) -> tuple[float, float]:
        """Return the distance from a goal [m], and the difference of heading [rad]."""
        error = self.state[:3] - goal
        return math.hypot(*error[:2]), abs(math.remainder(error[2], 2.0 * math.pi))

    def gap(self, footprint: Footprint) -> float:
        """Return how near the footprint ever came to a middle of an occupied cell [m]."""
        walls = self.grid.to_points(np.argwhere(self.grid.cells == 100))
        least = math.inf
        for x, y, yaw, *_ in self.places:
            cos, sin = math.cos(yaw), math.sin(yaw)
            apart = (walls - (x, y)) @ np.array(((cos, -sin), (sin, cos)))
            if footprint.is_circle:
                least = min(least, np.hypot(*apart.T).min() - footprint.radius)
                continue
            half = np.array((footprint.half_length, footprint.half_width))
            least = min(least, np.hypot(*np.maximum(np.abs(apart) - half, 0.0).T).min())
        return least


def wheels(grid: Grid = PARTED, pose: tuple[float, float, float] = (1.0, 1.0, 0.0)) -> Drive:
    return Drive(Driver(WHEELS, ROUND), WHEELS, grid, pose)


def legs(grid: Grid = PARTED, pose: tuple[float, float, float] = (1.0, 1.0, 0.0)) -> Drive:
    return Drive(Driver(LEGS, LONG, LEG_PLANNING), LEGS, grid, pose)


def box_seen(x: float, y: float, half: float) -> Callable[[np.ndarray], Scan]:
    """Return what sees the near sides of a square box, wherever it looks from."""
    share = np.linspace(-half, half, 9)
    sides = [(share, np.full(9, s * half)) for s in (-1.0, 1.0)]
    edge = np.concatenate([np.stack(side[::flip], axis=1) for side in sides for flip in (1, -1)])
    points = edge + (x, y)

    def look(pose: np.ndarray) -> Scan:
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        ends = (points - pose[:2]) @ np.array(((cos, -sin), (sin, cos)))
        return Scan(np.zeros(2), ends, np.ones(len(ends), bool))

    return look


@pytest.mark.parametrize(
    ('drive', 'footprint', 'near', 'turned'),
    [(wheels, ROUND, 0.05, 0.05), (legs, LONG, 0.10, math.radians(5.0))],
)
def test_it_drives_through_a_door_to_a_pose(
    drive: Callable[[], Drive], footprint: Footprint, near: float, turned: float
) -> None:
    robot, goal = drive(), np.array((5.0, 1.0, 2.0))
    robot.driver.set_goal(goal)
    assert robot.run(60.0) == 'arrived'
    off, turned_off = robot.off(goal)
    assert off <= near
    assert turned_off <= turned
    assert robot.gap(footprint) > 0.025  # half a cell
    assert robot.driver.recoveries == 0
    assert robot.run(1.0) == 'arrived'
    assert not robot.asked.any()


def test_a_long_robot_turns_before_a_gap_that_it_fits_through_one_way_only() -> None:
    narrow = room((2.9, 0.0, 3.05, 2.5), (2.9, 3.05, 3.05, 4.0))
    robot, goal = legs(narrow, (2.0, 1.0, math.pi / 2)), np.array((4.5, 2.0, math.pi / 2))
    robot.driver.set_goal(goal)
    assert robot.run(60.0) == 'arrived'
    assert robot.gap(LONG) > 0.025


def test_a_long_robot_goes_around_the_end_of_a_wall_no_farther_than_it_has_to() -> None:
    robot = legs(room((2.9, 0.0, 3.05, 2.0)), (2.4, 1.3, -math.pi / 2))
    robot.driver.set_goal(np.array((3.55, 1.3, math.pi / 2)))
    while not len(robot.driver.path) or not robot.asked.any():
        robot.run(DT)
    # The shortest way of a disc as wide as the robot that keeps the margin: tangents, and arcs
    # around both corners.
    ahead, up, reach = 0.5, 0.7, LONG.inscribed + LEG_PLANNING.margin
    tangent = math.sqrt(ahead**2 + up**2 - reach**2)
    arc = reach * (math.atan2(up, ahead) + math.asin(reach / math.hypot(ahead, up)))
    shortest = 2.0 * (tangent + arc) + 0.15
    assert robot.driver.distance_left <= 1.15 * shortest
    assert robot.run(60.0) == 'arrived'
    assert robot.gap(LONG) > 0.025


def test_what_is_asked_is_within_the_limits() -> None:
    robot = wheels()
    robot.driver.set_goal(np.array((0.6, 3.0, -1.0)))
    most = np.array((WHEELS.forward, 0.0, WHEELS.yaw)) + 1e-9
    for _ in range(200):
        robot.run(DT)
        assert (np.abs(robot.asked) <= most).all()
        assert robot.asked[0] >= -WHEELS.backward - 1e-9


def test_the_same_drive_is_the_same_to_the_bit() -> None:
    drives = [wheels(), wheels()]
    for robot in drives:
        robot.driver.set_goal(np.array((2.0, 3.0, 0.0)))
        robot.run(4.0)
    assert np.array_equal(*(np.array(robot.places) for robot in drives))


@pytest.mark.parametrize(
    ('goal', 'reason'),
    [
        ((2.97, 1.0, 0.0), 'is in an obstacle'),
        ((9.0, 1.0, 0.0), 'is outside the map, which goes from'),
        ((math.nan, 1.0, 0.0), 'must be finite numbers'),
        ((5.0, 1.0, 0.0), 'no way leads to (5.00, 1.00): it is shut off'),
    ],
)
def test_a_goal_that_cannot_be_reached_is_refused_at_once_with_the_reason(
    goal: tuple[float, float, float], reason: str
) -> None:
    robot = wheels(room((2.9, 0.0, 3.05, 4.0)))
    robot.driver.set_goal(np.array(goal))
    assert robot.run(0.2) == 'refused'
    assert reason in robot.driver.reason
    assert not robot.asked.any()


@pytest.mark.parametrize(('x', 'state'), [(2.5, 'recovering'), (30.0, 'refused')])
def test_people_who_are_about_are_waited_for_unless_the_goal_is_off_the_map(x, state) -> None:
    robot = wheels()
    robot.driver.set_goal(np.array((2.0, 1.0, 0.0)))
    robot.run(0.2)
    around = robot.driver._around
    around.layer.marks[20, 20], around.movers._since = 3, 0.0  # somebody has just gone by,
    around.layer._last = np.array([[20.5, 20.5, 0.06]])  # and is in sight
    robot.driver.set_goal(np.array((x, 1.0, 0.0)))
    robot.driver._refuse('no way', 0.05)
    assert robot.driver.state == state


def test_a_goal_that_nobody_has_looked_at_is_refused() -> None:
    grid = room()
    grid.cells[30:50, 80:110] = -1
    robot = wheels(grid)
    robot.driver.set_goal(np.array((4.7, 2.0, 0.0)))
    assert robot.run(0.2) == 'refused'
    assert 'is unknown' in robot.driver.reason


def test_a_way_leads_through_what_nobody_has_looked_at_when_there_is_no_other() -> None:
    grid = room()
    grid.cells[1:-1, 50:80] = -1
    robot = wheels(grid)
    robot.driver.set_goal(np.array((5.0, 1.0, 0.0)))
    assert robot.run(30.0) == 'arrived'


def test_a_box_that_appears_is_driven_around() -> None:
    robot, goal = wheels(room(), (1.0, 2.0, 0.0)), np.array((5.0, 2.0, 0.0))
    robot.driver.set_goal(goal)
    robot.run(2.0)
    robot.look = box_seen(3.0, 2.0, 0.2)
    robot.run(1.0)
    assert np.abs(robot.driver.path - (3.0, 2.0)).max(axis=1).min() > 0.3
    assert robot.run(30.0) == 'arrived'
    apart = np.abs(np.array(robot.places)[:, :2] - (3.0, 2.0)) - 0.2
    assert np.hypot(*np.maximum(apart, 0.0).T).min() > ROUND.radius


def test_a_way_does_not_cut_the_corner_of_a_box_whose_other_sides_are_not_seen_yet() -> None:
    robot = wheels(room(), (1.0, 2.0, 0.0))
    robot.driver.set_goal(np.array((3.0, 2.1, 0.0)))
    robot.run(DT)
    # A face, 0.4 m of box behind it; the way leads past its right end, and back behind it.
    face = np.stack((np.full(23, 2.2), np.linspace(1.85, 2.4, 23)), axis=1)

    def look(pose: np.ndarray) -> Scan:
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        ends = (face - pose[:2]) @ np.array(((cos, -sin), (sin, cos)))
        return Scan(np.zeros(2), ends, np.ones(len(ends), bool))

    robot.look = look
    robot.run(0.5)
    way = robot.driver.path
    assert way[:, 1].min() < 1.85
    apart = np.maximum(np.maximum((2.2, 1.85) - way, way - (2.6, 2.4)), 0.0)
    assert np.hypot(*apart.T).min() > ROUND.radius


def test_no_step_draws_more_than_a_slice_so_that_whoever_presses_a_key_need_not_wait(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    counts: list[int] = []

    def counting(lattice: Any, budget: int) -> bool:
        counts.append(budget)
        return spread(lattice, budget)

    monkeypatch.setattr(heading_field, 'spread', counting)
    robot = legs(room((2.9, 0.0, 3.05, 2.4)), (1.0, 1.0, 0.0))
    robot.driver.set_goal(np.array((5.0, 1.0, 0.0)))
    robot.run(DT)
    assert not counts  # it is looked first whether the goal is one
    for _ in range(60):
        robot.run(DT)
        # While it stands, and has nothing else to do, it may draw more.
        stands = not robot.asked.any()
        assert sum(counts) <= (AT_ONCE * SLICE if stands else SLICE)
        counts.clear()
    assert robot.driver.state == 'driving'
    assert robot.state[0] > 1.3


def test_in_a_gap_where_prices_take_long_a_slice_comes_less_far() -> None:
    # A corridor of 0.45 m, in which each place stands for a pose that is looked for.
    grid = room((0.0, 0.0, 6.0, 1.75), (0.0, 2.2, 6.0, 4.0))
    around, base = Surroundings(LONG, LEG_PLANNING), base_of(LEGS)
    around.take_map(grid, 0, np.zeros(2))
    goal, margins = np.array((3.0, 1.975, 0.0)), (0.03, 0.04)
    field = HeadingField(goal, around, LONG.circles, base, margins)
    lattice, budget = field._lattice, 500
    assert not spread(lattice, budget)
    priced = np.argwhere(~np.isnan(lattice.price[0]))
    prices = [set_price(lattice, row, column) for row, column in priced]
    # The last state that is looked at may be beside places without prices.
    assert sum(prices) <= budget + len(lattice.moves) * max(prices)


def test_a_blocked_way_is_drawn_anew_at_once_though_another_drawing_is_under_way(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr('wasd_navigation.planning.route.SLICE', 1000)  # one takes about 1.5 s
    robot, goal = legs(room(), (1.0, 2.0, 0.0)), np.array((5.0, 2.0, 0.0))
    robot.driver.set_goal(goal)
    robot.run(1.0)
    # Something beside the way: that is drawn in time.
    robot.look = box_seen(2.0, 0.3, 0.1)
    robot.run(0.5)
    assert robot.driver._route is not None and robot.driver._route.is_drawing
    begun = robot.driver._route._next
    robot.look = box_seen(3.2, 2.0, 0.2)
    robot.run(DT)
    urgent = robot.driver._route._next
    assert urgent is not begun
    while robot.driver._route.is_drawing:
        assert robot.driver._route._next is urgent
        robot.run(DT)
    assert np.abs(robot.driver.path - (3.2, 2.0)).max(axis=1).min() > 0.2


def test_a_blocked_way_is_drawn_as_fast_as_the_first_one(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ('route', 'driver'):
        monkeypatch.setattr(f'wasd_navigation.planning.{name}.SLICE', 1000)
    robot = legs(room(), (1.0, 2.0, 0.0))
    robot.driver.set_goal(np.array((5.0, 2.0, 0.0)))
    robot.run(DT)  # it is looked whether that is a goal
    first = 0
    while not len(robot.driver.path):
        first += 1
        robot.run(DT)
    robot.run(1.0)
    robot.look = box_seen(3.2, 2.0, 0.2)
    second = 0
    while np.abs(robot.driver.path - (3.2, 2.0)).max(axis=1).min() < 0.2:
        second += 1
        robot.run(DT)
    assert second <= first + 2  # in a room as small as that each draws nearly all of it


@pytest.mark.parametrize('depth', [0.03, 0.045, 0.05, 0.06, 0.07, 0.08])
def test_a_flat_box_before_a_wall_is_not_touched_by_who_stops_beside_it(depth: float) -> None:
    robot = wheels(room(), (2.2, 0.6, 0.0))
    box = np.array(((2.8, 0.05), (3.2, 0.05 + depth)))
    robot.look = lidar_of_room(box)
    robot.driver.set_goal(np.array((3.0, 0.05 + ROUND.inscribed + 0.06, 0.0)))
    robot.run(12.0)
    places = np.array(robot.places)[:, :2]
    assert np.hypot(*(places - (3.0, 0.31)).T).min() < 0.5
    apart = np.maximum(np.maximum(box[0] - places, places - box[1]), 0.0)
    assert np.hypot(*apart.T).min() > ROUND.radius


def lidar_of_room(box: np.ndarray) -> Callable[[np.ndarray], Scan]:
    """Return a lidar with a noise of 12 mm in the room with a box (low and high corner)."""
    rays, random = np.linspace(-3.14, 3.14, 360), np.random.default_rng(0)
    inside = np.array(((0.05, 0.05), (5.95, 3.95)))

    def look(pose: np.ndarray) -> Scan:
        along = np.stack((np.cos(rays + pose[2]), np.sin(rays + pose[2])))
        walls = [(corner - pose[:2])[:, None] / along for corner in inside]
        sides = [(corner - pose[:2])[:, None] / along for corner in box]
        ranges = np.maximum(*walls).min(axis=0)
        near, far = np.minimum(*sides).max(axis=0), np.maximum(*sides).min(axis=0)
        ranges = np.where((near < far) & (near > 0.0), np.minimum(near, ranges), ranges)
        ranges += 0.012 * random.normal(size=len(rays))
        ends = np.stack((ranges * np.cos(rays), ranges * np.sin(rays)), axis=1)
        return Scan(np.zeros(2), ends, np.ones(len(rays), bool))

    return look


def test_a_goal_beside_a_wall_is_come_as_near_as_one_may_and_that_is_said() -> None:
    robot = wheels(room((2.9, 0.0, 3.05, 4.0)))
    robot.driver.set_goal(np.array((2.75, 1.0, 0.0)))
    assert robot.run(30.0) == 'arrived'
    # 0.2 m of robot and three quarters of the margin from the wall, in cells of 5 cm.
    off = math.dist(robot.state[:2], (2.75, 1.0))
    assert 0.07 < off < 0.15
    assert robot.driver.reason == 'as near as possible: 0.10 m from it'
    assert robot.gap(ROUND) > 0.02


def test_without_tolerance_such_a_goal_is_refused() -> None:
    driver = Driver(WHEELS, ROUND, PlanningParameters(tolerance=0.0))
    robot = Drive(driver, WHEELS, room((2.9, 0.0, 3.05, 4.0)), (1.0, 1.0, 0.0))
    robot.driver.set_goal(np.array((2.75, 1.0, 0.0)))
    assert robot.run(0.2) == 'refused'
    needs = 'is too near an obstacle: the robot needs 0.03 m around it, and would overlap by'
    assert needs in robot.driver.reason


def test_a_goal_whose_room_goes_while_it_drives_is_come_near_all_the_same() -> None:
    robot = wheels(room())
    goal = (4.0, 2.0, 0.0)
    robot.driver.set_goal(np.array(goal))
    robot.run(3.0)
    robot.grid = room((4.2, 2.0, 4.25, 2.05))  # a cell of a map that grows
    robot.revision = 1
    assert robot.run(30.0) == 'arrived'
    assert 0.0 < math.dist(robot.state[:2], goal[:2]) < 0.12
    assert robot.driver.reason.startswith('as near as possible')


def test_the_words_of_a_refusal_say_how_wide_the_widest_way_is() -> None:
    # A door of 0.4 m, by cells; the robot needs 0.46.
    robot = wheels(room((2.9, 0.0, 3.05, 2.4), (2.9, 2.8, 3.05, 4.0)))
    robot.driver.set_goal(np.array((5.0, 1.0, 0.0)))
    assert robot.run(0.2) == 'refused'
    widest = float(
        robot.driver.reason.partition('in the map the widest is about ')[2].partition(' ')[0]
    )
    assert widest == pytest.approx(0.4, abs=0.06)
    assert robot.driver.reason.endswith('0.42 are needed')


def test_a_way_that_is_too_narrow_is_not_said_to_be_as_wide_as_is_needed(monkeypatch) -> None:
    robot, needed = wheels(room((2.9, 0.0, 3.05, 2.4), (2.9, 2.8, 3.05, 4.0))), 0.2273
    monkeypatch.setattr(route, 'IN_GAP', (needed - ROUND.inscribed) / PlanningParameters().margin)
    is_wide = lambda cell, values, least: np.full(values.shape, least < needed - 1e-4)  # noqa: E731
    monkeypatch.setattr(route, 'flood', is_wide)
    robot.driver.set_goal(np.array((5.0, 1.0, 0.0)))
    robot.run(0.2)
    assert robot.driver.reason.endswith('about 0.44 m wide, 0.46 are needed')


def test_a_door_that_stays_closed_makes_it_give_up_with_the_reason() -> None:
    robot = wheels()
    robot.driver.set_goal(np.array((5.0, 1.0, 0.0)))
    robot.run(1.0)
    robot.look = box_seen(2.975, 2.8, 0.35)
    assert robot.run(60.0) == 'failed'
    assert robot.driver.reason.startswith(
        'no way leads to (5.00, 1.00): in the map the widest is about'
    )
    assert robot.driver.recoveries == PlanningParameters().recoveries
    assert robot.gap(ROUND) > 0.025


def test_what_it_has_backed_up_is_no_progress_when_it_comes_again() -> None:
    robot = Drive(
        Driver(WHEELS, ROUND, PlanningParameters(recoveries=1, stuck_time=1.0)),
        WHEELS,
        room(),
        (1.0, 2.0, 0.0),
    )

    def sill(pose: np.ndarray) -> Scan:
        robot.state[0] = min(robot.state[0], 1.5)
        return NOTHING

    robot.look = sill
    robot.driver.set_goal(np.array((5.0, 2.0, 0.0)))
    assert robot.run(20.0) == 'failed'
    assert robot.driver.reason.endswith('after 1 recoveries')


def test_a_door_that_opens_again_lets_it_go_on() -> None:
    robot, goal = wheels(), np.array((5.0, 1.0, 0.0))
    robot.driver.set_goal(goal)
    robot.run(1.0)
    robot.look = box_seen(2.975, 2.8, 0.35)
    assert robot.run(4.0) == 'recovering'
    robot.look = lambda pose: NOTHING
    assert robot.run(60.0) == 'arrived'


def test_a_goal_is_driven_to_from_where_the_robot_is_not_from_where_it_was() -> None:
    robot = wheels(room())
    robot.driver.set_goal(np.array((1.5, 1.0, 0.0)))
    assert robot.run(20.0) == 'arrived'
    robot.state[1] += 0.14  # by hand, and so little that noise could say it
    robot.driver.set_goal(np.array((3.0, 1.0, 0.0)))
    begin = robot.state[:3].copy()
    robot.run(DT)
    assert robot.driver._pose == pytest.approx(begin, abs=1e-9)


@pytest.mark.parametrize('axis', range(6))
def test_it_stands_on_a_pose_or_velocity_that_is_no_number(axis: int) -> None:
    robot = wheels(room())
    robot.driver.set_goal(np.array((3.0, 1.0, 0.0)))
    robot.run(1.0)
    known = robot.state.copy()
    known[axis] = math.nan
    asked = robot.driver.step(robot.grid, 0, known[:3], known[3:], NOTHING, DT)
    assert not asked.any()
    assert 'not a number' in robot.driver.reason
    robot.run(1.0)
    assert robot.asked.any()


def test_a_cancelled_goal_asks_for_no_velocity() -> None:
    robot = wheels()
    robot.driver.set_goal(np.array((5.0, 1.0, 0.0)))
    robot.run(2.0)
    assert robot.driver.distance_left > 1.0
    assert robot.driver.time_left > 2.0
    robot.driver.cancel()
    robot.run(DT)
    assert robot.driver.state == 'idle'
    assert not robot.asked.any()
    assert robot.driver.distance_left == 0.0


def test_the_costmap_tells_obstacles_from_what_is_near_and_what_is_free() -> None:
    robot = wheels()
    robot.driver.set_goal(np.array((5.0, 1.0, 0.0)))
    robot.run(DT)
    costmap = robot.driver.costmap
    assert costmap is not None
    assert (costmap.cells[robot.grid.cells == 100] == 100).all()
    assert costmap.cells[20, 57 - 3] == 99
    assert costmap.cells[20, 20] == 0


@pytest.mark.parametrize('robot', [wheels, legs])
def test_goals_one_after_another_do_not_make_a_driving_robot_stand(
    robot: Callable[..., Drive],
) -> None:
    drive = robot()
    drive.driver.set_goal(np.array((5.0, 1.0, 0.0)))
    drive.run(2.0)
    assert drive.asked.any()
    for y in (0.9, 1.0, 1.1):
        drive.driver.set_goal(np.array((5.0, y, 0.0)))
        for _ in range(10):
            drive.run(DT)
            assert drive.asked.any()
    # The one before leads on for a second in all, however often another one comes.
    drive.driver.set_goal(np.array((1.0, 1.2, 0.0)))
    for _ in range(round(1.5 / DT)):
        drive.driver.set_goal(np.array((1.0, 1.2, 0.0)))
        drive.run(DT)
    assert not drive.asked.any()
    assert drive.run(60.0) == 'arrived'


def test_a_goal_that_is_refused_ends_the_one_before() -> None:
    drive = wheels()
    drive.driver.set_goal(np.array((5.0, 1.0, 0.0)))
    drive.run(2.0)
    drive.driver.set_goal(np.array((99.0, 1.0, 0.0)))
    assert drive.run(DT) == 'refused'
    assert not drive.asked.any()


def test_a_goal_is_not_refused_for_marks_that_are_out_of_sight() -> None:
    drive = wheels()
    drive.look = box_seen(2.97, 2.8, 0.35)  # in the door
    drive.driver.set_goal(np.array((1.1, 1.0, 0.0)))
    drive.run(0.5)
    drive.look = lambda pose: NOTHING
    drive.run(20.0)
    drive.driver.set_goal(np.array((5.0, 2.0, 0.0)))
    assert drive.run(60.0) == 'arrived'


def test_a_goal_behind_what_stands_in_the_door_is_refused_where_nobody_has_moved() -> None:
    drive = wheels()
    drive.look = box_seen(2.97, 2.8, 0.35)
    drive.driver.set_goal(np.array((1.1, 1.0, 0.0)))
    drive.run(0.5)
    drive.driver.set_goal(np.array((5.0, 2.0, 0.0)))
    assert drive.run(2.0) == 'refused'
