# SPDX-License-Identifier: Apache-2.0
"""Goals where nobody has looked yet: a robot that maps drives there through the unknown."""

import math

from navigation_stand_ins import odometry, StandInLocator
import numpy as np
import pytest
from terminals import PATIENCE
from wasd_navigation.exploring import Explorer
from wasd_navigation.navigator import BEYOND, Navigator
from wasd_navigation.parameters import DriveLimits, Footprint, PlanningParameters
from wasd_navigation.planning.driver import Driver
from wasd_navigation.planning.motion import base_of, move
from wasd_navigation.records import Grid, Scan
from wasd_navigation.se2 import inverse, transform

# Each drives a robot for a while.
pytestmark = pytest.mark.slow

DT = 0.05
NOTHING = Scan(np.zeros(2), np.zeros((0, 2)), np.zeros(0, bool))
SIZES = pytest.mark.parametrize(
    'footprint', [Footprint(radius=0.2), Footprint(half_length=0.34, half_width=0.164)]
)


class Rooms(StandInLocator):
    """
    Two rooms of 3 x 4 m with a door between them; the second is seen from the door on.

    It maps: at first its grid ends with the wall between them.
    """

    grows = True

    def __init__(self, door: float = 0.9, inside: tuple[int, int, int, int] | None = None) -> None:
        super().__init__()
        self.correction = np.zeros(3)
        self._all = np.zeros((80, 121), np.int8)
        self._all[:1] = self._all[-1:] = self._all[:, :1] = self._all[:, -1:] = 100
        self._all[:, 60:62] = 100
        half = round(0.5 * door / 0.05)
        self._all[40 - half : 40 + half, 60:62] = 0
        if inside is not None:
            row, column, to_row, to_column = inside
            self._all[row:to_row, column:to_column] = 100
        self._is_second = False
        self._draw()

    def look(self, pose: np.ndarray) -> None:
        if pose[0] > 2.7 and not self._is_second:
            self._is_second = True
            self.revision += 1
            self._draw()

    def scan(self, pose: np.ndarray) -> Scan:
        return NOTHING

    def _draw(self) -> None:
        cells = self._all if self._is_second else self._all[:, :62]
        self.grid = Grid(cells.copy(), 0.05, (0.0, 0.0))


class SomebodyStood(Rooms):
    """The first room, where somebody stands in the map; he has gone once the robot is near."""

    PLACE = (2.0, 0.9)

    def __init__(self, goes: bool, width: float = 0.45) -> None:
        self._is_there, self._goes, self._width = True, goes, width
        super().__init__(door=0.0)

    def look(self, pose: np.ndarray) -> None:
        if self._goes and self._is_there and math.dist(pose[:2], self.PLACE) < 0.8:
            self._is_there = False
            self.revision += 1
            self._draw()

    def scan(self, pose: np.ndarray) -> Scan:
        if not self._is_there:
            return NOTHING
        ends = transform(inverse(pose), np.array([self.PLACE]))
        return Scan(np.zeros(2), ends, np.ones(1, bool))

    def _draw(self) -> None:
        super()._draw()
        half, (x, y) = 0.5 * self._width, self.PLACE
        low, high = self.grid.to_cells(np.array(((x - half, y - 0.1), (x + half, y + 0.1))))
        self.grid.cells[low[0] : high[0], low[1] : high[1]] = 100 * self._is_there


class SomebodyComes(Rooms):
    """The first room; somebody walks to a place, stands there for six seconds, and walks on."""

    def __init__(self, place: tuple[float, float]) -> None:
        super().__init__(door=0.0)
        self._time, self._place = 0.0, np.array(place)

    def scan(self, pose: np.ndarray) -> Scan:
        self._time += DT
        along = 0.5 * (min(self._time - 1.5, 0.0) + max(self._time - 7.5, 0.0))
        angles = np.linspace(-math.pi, math.pi, 360, endpoint=False)
        rays = np.column_stack((np.cos(angles), np.sin(angles)))
        to = transform(inverse(pose), self._place[None] + (0.0, along))[0]
        ahead, aside = rays @ to, np.abs(rays[:, 0] * to[1] - rays[:, 1] * to[0])
        hits = (ahead > 0.0) & (aside < 0.2)
        lengths = np.where(hits, ahead - np.sqrt(np.maximum(0.04 - aside**2, 0.0)), 6.0)
        return Scan(np.zeros(2), lengths[:, None] * rays, hits)


class Drive:
    """A robot of a footprint that begins in the first room and is sent to a goal."""

    def __init__(
        self,
        rooms: Rooms,
        footprint: Footprint,
        goal: tuple[float, ...],
        tolerance: float = 0.3,
    ) -> None:
        limits, parameters = DriveLimits(), PlanningParameters(tolerance=tolerance)
        explorer = Explorer(footprint, parameters)
        self.rooms, self.words = rooms, set()
        driver = Driver(limits, footprint, parameters)
        self.navigator = Navigator(rooms, driver, explorer=explorer)
        self.base, self.state = base_of(limits), np.array((1.0, 2.0, 0.0, 0.0, 0.0, 0.0))
        self._sense()
        self.navigator.set_goal(np.array(goal))

    def _sense(self) -> None:
        here = odometry(*self.state[:3])
        self.navigator.move(here)
        self.rooms.look(self.state)
        self.navigator.see(self.rooms.scan(self.state[:3]), here)

    def run(self, seconds: float = PATIENCE) -> str:
        """Drive until the goal has ended; return how."""
        for _ in range(round(seconds / DT)):
            self._sense()
            velocity = self.navigator.step(DT)
            if velocity is None:
                break
            self.words.add(self.navigator.reason)
            move(self.state, velocity, self.base, DT)
        return self.navigator.state

    def off(self, goal: tuple[float, ...]) -> float:
        return math.dist(self.state[:2], goal[:2])


@SIZES
def test_a_goal_beyond_the_map_is_driven_to_and_it_says_so(footprint) -> None:
    goal = (4.8, 1.0, 0.0)
    drive = Drive(Rooms(), footprint, goal)
    assert drive.run() == 'arrived'
    assert drive.off(goal) < 0.06
    assert '(4.80, 1.00) is unknown: the robot drives there to look' in drive.words


@SIZES
def test_where_an_obstacle_is_found_at_the_goal_it_fails_and_says_so(footprint) -> None:
    drive = Drive(Rooms(inside=(10, 85, 40, 115)), footprint, (5.0, 1.2, 0.0))
    assert drive.run() == 'failed'
    assert 'obstacle' in drive.navigator.reason


def test_near_an_obstacle_at_the_goal_the_nearest_place_will_do() -> None:
    goal = (4.8, 1.0, 0.0)
    drive = Drive(Rooms(inside=(10, 100, 30, 115)), Footprint(radius=0.2), goal)
    assert drive.run() == 'arrived'
    assert 0.0 < drive.off(goal) < 0.3
    assert 'as near as possible' in drive.navigator.reason


@SIZES
def test_a_goal_behind_a_wall_without_a_door_is_refused_at_once(footprint) -> None:
    drive = Drive(Rooms(door=0.0), footprint, (4.8, 1.0, 0.0))
    assert drive.run(2.0) == 'refused'
    assert 'no way leads to (4.80, 1.00)' in drive.navigator.reason
    assert drive.state[:2] == pytest.approx((1.0, 2.0))


@SIZES
def test_a_goal_in_a_wall_is_refused_at_once_whatever_may_be_behind_it(footprint) -> None:
    drive = Drive(Rooms(), footprint, (1.0, -0.1, 0.0))
    assert drive.run(2.0) == 'refused'
    assert 'obstacle' in drive.navigator.reason
    assert drive.state[:2] == pytest.approx((1.0, 2.0))


@SIZES
def test_a_goal_where_somebody_stood_is_driven_to_and_reached_once_he_has_gone(footprint) -> None:
    goal = (*SomebodyStood.PLACE, 0.0)
    drive = Drive(SomebodyStood(goes=True), footprint, goal)
    assert drive.run() == 'arrived'
    assert drive.off(goal) < 0.06
    assert '(2.00, 0.90) is in an obstacle: the robot drives there to look' in drive.words


@SIZES
def test_where_somebody_still_stands_the_robot_fails_beside_him_and_says_so(footprint) -> None:
    goal = (*SomebodyStood.PLACE, 0.0)
    drive = Drive(SomebodyStood(goes=False), footprint, goal)
    assert drive.run() == 'failed'
    assert 'an obstacle' in drive.navigator.reason
    assert 0.3 < drive.off(goal) < 0.8


def test_a_goal_where_somebody_comes_and_stands_for_a_while_is_reached_when_he_walks_on() -> None:
    goal = (2.6, 1.2, 0.0)
    drive = Drive(SomebodyComes(goal[:2]), Footprint(radius=0.2), goal, tolerance=0.0)
    assert drive.run() == 'arrived'
    assert drive.off(goal) < 0.06


def test_a_goal_in_what_is_too_wide_to_go_away_is_refused_at_once() -> None:
    goal = (*SomebodyStood.PLACE, 0.0)
    drive = Drive(SomebodyStood(goes=True, width=1.4), Footprint(radius=0.2), goal)
    assert drive.run(2.0) == 'refused'
    assert drive.state[:2] == pytest.approx((1.0, 2.0))


def test_a_goal_outside_all_walls_fails_once_all_that_can_be_seen_is() -> None:
    drive = Drive(Rooms(), Footprint(radius=0.2), (9.0, 2.0, 0.0))
    assert drive.run() == 'failed'
    assert 'no way leads to (9.00, 2.00)' in drive.navigator.reason


def test_a_goal_farther_beyond_the_map_than_any_is_taken_is_refused() -> None:
    drive = Drive(Rooms(), Footprint(radius=0.2), (4.0 + BEYOND, 2.0, 0.0))
    assert drive.run(2.0) == 'refused'
    assert 'outside the map' in drive.navigator.reason


def test_in_a_saved_map_where_nobody_has_looked_is_no_goal() -> None:
    rooms = Rooms()
    rooms.grows = False
    drive = Drive(rooms, Footprint(radius=0.2), (4.8, 1.0, 0.0))
    assert drive.run(2.0) == 'refused'
    assert 'outside the map' in drive.navigator.reason


def test_a_map_that_reaches_farther_has_the_same_cells_where_they_were() -> None:
    grid = Grid(np.array([[0, 100, 0], [0, 0, 0], [0, 0, 100]], np.int8), 0.5, (1.0, -2.0))
    point = np.array((-3.2, 4.1))
    grown = grid.grown_to(point, 1.0)
    cells = np.argwhere(grid.cells >= 0)
    moved = grown.to_cells(grid.to_points(cells))
    assert (grown.cells[tuple(moved.T)] == grid.cells.ravel()).all()
    assert np.count_nonzero(grown.cells >= 0) == 9
    assert all(grown.has(point + step) for step in ((-1.0, -1.0), (1.0, 1.0)))
    assert grown.grown_to(point, 1.0) is grown
