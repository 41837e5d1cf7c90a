# SPDX-License-Identifier: Apache-2.0
"""Goals where nobody has looked yet: a robot that maps drives there through the unknown."""

import math

from navigation_stand_ins import odometry, StandInLocator
import numpy as np
import pytest
from wasd_navigation.exploring import Explorer
from wasd_navigation.navigator import BEYOND, Navigator
from wasd_navigation.parameters import DriveLimits, Footprint, PlanningParameters
from wasd_navigation.planning.driver import Driver
from wasd_navigation.planning.motion import base_of, move
from wasd_navigation.records import Grid, Scan

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

    def _draw(self) -> None:
        cells = self._all if self._is_second else self._all[:, :62]
        self.grid = Grid(cells.copy(), 0.05, (0.0, 0.0))


class Drive:
    """A robot of a footprint that begins in the first room and is sent to a goal."""

    def __init__(self, rooms: Rooms, footprint: Footprint, goal: tuple[float, ...]) -> None:
        limits, parameters = DriveLimits(), PlanningParameters()
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
        self.navigator.see(NOTHING, here)

    def run(self, seconds: float = 60.0) -> str:
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
