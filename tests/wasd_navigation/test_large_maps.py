# SPDX-License-Identifier: Apache-2.0
"""Maps that are too large to be looked at as a whole, and gaps hardly wider than the robot."""

import math

from cases import for_all
import numpy as np
import pytest
from wasd_navigation.parameters import DriveLimits, Footprint, PlanningParameters
from wasd_navigation.planning.driver import Driver
from wasd_navigation.planning.motion import base_of, move
from wasd_navigation.planning.overview import Overview, PLACE, Rooms
from wasd_navigation.planning.route import Route
from wasd_navigation.planning.surroundings import EDGE, Surroundings, WINDOW
from wasd_navigation.records import Grid

ROUND, LONG = Footprint(radius=0.2), Footprint(half_length=0.34, half_width=0.164)
PARAMETERS = PlanningParameters()
REACH = 0.23


def building(size: float = 30.0, doors: tuple[float, ...] = (2.0, 26.0, 2.0)) -> Grid:
    """Return a square with walls across at equal distances, each with a door of 1 m at some y."""
    count = round(size / 0.05)
    cells = np.zeros((count, count), np.int8)
    cells[:1] = cells[-1:] = cells[:, :1] = cells[:, -1:] = 100
    for number, door in enumerate(doors, start=1):
        column = round(number * count / (len(doors) + 1))
        cells[:, column : column + 2] = 100
        row = round(door / 0.05)
        cells[row : row + 20, column : column + 2] = 0
    return Grid(cells, 0.05, (0.0, 0.0))


def around(grid: Grid, place=(1.0, 1.0)) -> Surroundings:
    surroundings = Surroundings(ROUND, PARAMETERS)
    surroundings.take_map(grid, 0, np.array(place))
    return surroundings


def overview(goal, grid: Grid, place=(1.0, 1.0)) -> Overview:
    found = Overview(np.array(goal), around(grid, place), Rooms(), REACH)
    while not found.work():
        pass
    return found


@for_all('place', [(1.0, 1.0), (15.0, 15.0), (29.0, 3.0)])
def test_no_more_than_a_window_of_a_large_map_is_looked_at(place) -> None:
    grid = building()
    looked = around(grid, place)
    assert looked.is_windowed
    assert looked.grid.cells.shape == (round(WINDOW / 0.05),) * 2
    row, column = looked.corner
    rows, columns = looked.grid.cells.shape
    assert (grid.cells[row : row + rows, column : column + columns] == looked.grid.cells).all()
    assert looked.grid.has(np.array(place))


def test_the_window_follows_before_the_robot_comes_to_its_edge() -> None:
    looked = around(building(), (10.0, 10.0))
    for x in np.arange(10.0, 29.0, 0.25):
        place = np.array((x, 10.0))
        looked.take_map(looked.whole, 0, place)
        low = looked.grid.origin[0]
        assert x - low >= EDGE - 0.3
        assert low + WINDOW - x >= min(EDGE - 0.3, 30.0 - x)


def test_across_a_building_what_is_left_is_the_way_through_its_doors() -> None:
    found = overview((29.0, 1.0, 0.0), building())
    corners = [(1.0, 1.0), (7.5, 2.3), (15.0, 26.3), (22.5, 2.8), (29.0, 1.0)]
    way = sum(math.dist(*pair) for pair in zip(corners, corners[1:], strict=False))
    left = float(found.at(np.array(((1.0, 1.0),)))[0])
    assert left == pytest.approx(way, rel=0.06)
    places = found.way_from(np.array((1.0, 1.0)))
    assert math.dist(places[-1], (29.0, 1.0)) < 0.5


def test_no_way_leads_through_a_wall_or_a_door_that_is_too_narrow() -> None:
    closed = building(doors=())
    closed.cells[:, 300:301] = 100  # one cell thick
    assert overview((29.0, 1.0, 0.0), closed).at(np.array(((1.0, 1.0),)))[0] == math.inf
    closed.cells[100:108, 300] = 0  # 0.4 m, and 0.46 are needed
    assert overview((29.0, 1.0, 0.0), closed).at(np.array(((1.0, 1.0),)))[0] == math.inf
    closed.cells[100:116, 300] = 0
    assert overview((29.0, 1.0, 0.0), closed).at(np.array(((1.0, 1.0),)))[0] < 40.0


def test_rooms_of_a_map_that_has_changed_are_those_of_the_new_one() -> None:
    rooms, grid = Rooms(), building()
    rooms.take(grid, 65)
    while rooms.work(100):
        pass
    changed = Grid(grid.cells.copy(), grid.resolution, grid.origin)
    changed.cells[300:310, 100:110] = 100
    rooms.take(changed, 65)
    waiting = len(rooms._waiting)
    assert 0 < waiting <= 4
    rooms.work(waiting)
    fresh = Rooms()
    fresh.take(changed, 65)
    fresh.work(100)
    assert (rooms.values == fresh.values).all()
    assert rooms.values[300 // PLACE, 100 // PLACE] < 0.0


def drive(driver: Driver, grid: Grid, start, goal, limits, seconds=120.0):
    """Return the state of a driver, where the robot is then, and all places."""
    base, state = base_of(limits), np.array((*start, 0.0, 0.0, 0.0))
    places = []
    driver.set_goal(np.array(goal))
    for _ in range(round(seconds / 0.05)):
        asked = driver.step(grid, 0, state[:3].copy(), state[3:].copy(), None, 0.05)
        move(state, asked, base, 0.05)
        places.append(state.copy())
        if not driver.is_under_way:
            break
    return driver.state, state, np.array(places)


@pytest.mark.slow
def test_a_robot_crosses_a_building_to_a_goal_it_does_not_look_at() -> None:
    limits = DriveLimits(forward=1.0)
    grid = building(doors=(14.0, 16.0))
    driver = Driver(limits, ROUND)
    state, there, places = drive(driver, grid, (2.0, 14.0, 0.0), (27.0, 15.0, 0.0), limits)
    assert state == 'arrived'
    assert math.dist(there[:2], (27.0, 15.0)) < 0.05
    way = np.hypot(*np.diff(places[:, :2], axis=0).T).sum()
    assert way < 1.15 * 25.5


@pytest.mark.slow
def test_what_no_way_leads_to_in_a_building_is_refused() -> None:
    closed = building(doors=())
    closed.cells[:, 300:302] = 100
    driver = Driver(DriveLimits(), ROUND)
    state, _, places = drive(driver, closed, (2.0, 2.0, 0.0), (27.0, 15.0, 0.0), DriveLimits())
    assert state == 'refused'
    assert driver.reason == 'no way leads to (27.00, 15.00)'
    assert len(places) < 40


@pytest.mark.slow
@pytest.mark.parametrize(('yaw', 'room'), [(0.3, 0.09), (0.8, 0.10), (1.2, 0.12)])
def test_a_gap_that_was_entered_is_left(yaw: float, room: float) -> None:
    cells = np.zeros((160, 160), np.int8)
    grid = Grid(cells, 0.05, (-4.0, -4.0))
    points = grid.to_points(np.argwhere(cells == 0))
    along = points @ (math.cos(yaw), math.sin(yaw))
    across = np.abs(points @ (-math.sin(yaw), math.cos(yaw)))
    is_wall = (np.abs(along) < 0.5) & (across > LONG.half_width + room)
    cells[is_wall.reshape(cells.shape)] = 100
    limits = DriveLimits(forward=0.4, backward=0.3, lateral=0.3, yaw=0.5, lag=0.3)
    driver = Driver(limits, LONG, PlanningParameters(xy_goal_tolerance=0.1))
    ahead = np.array((math.cos(yaw), math.sin(yaw)))
    state, inside, _ = drive(driver, grid, (*(-1.5 * ahead), yaw), (0.0, 0.0, yaw), limits)
    assert state == 'arrived', driver.reason
    goal = (*(1.5 * ahead), yaw + 2.0)
    state, _, _ = drive(driver, grid, inside[:3], goal, limits)
    assert state == 'arrived', driver.reason


def corridor(length: float) -> Grid:
    """Return a room with a corridor along x, 45 cm wide, at y = 2.5 cm."""
    cells = np.zeros((80, 160), np.int8)
    half = round(0.5 * length / 0.05)
    cells[:36, 80 - half : 80 + half] = cells[45:, 80 - half : 80 + half] = 100
    return Grid(cells, 0.05, (-4.0, -2.0))


@for_all('length', [0.4, 1.0])
def test_a_robot_in_a_gap_plans_out_with_the_room_that_it_has(length: float) -> None:
    grid, pose = corridor(length), np.array((0.0, 0.025, 0.0))
    parameters = PlanningParameters(margin=0.1)  # there are 6 cm on each side
    surroundings = Surroundings(LONG, parameters)
    surroundings.take_map(grid, 0, pose[:2])
    limits = DriveLimits(forward=0.4, backward=0.3, lateral=0.3, yaw=0.5)
    route = Route(np.array((2.0, 0.0, 0.0)), LONG, base_of(limits), parameters)
    route.draw(surroundings)
    while route.is_drawing:
        route.work(pose, 1 << 40)
    # No metre of it is so dear as one on which it has to find out of where nobody may be.
    assert route.left(pose) < 3.0 * 2.0


def test_a_robot_that_comes_where_no_way_was_drawn_from_draws_one_through_gaps() -> None:
    grid, pose = corridor(1.0), np.array((-2.0, 0.0, 0.0))
    parameters = PlanningParameters(margin=0.1)
    surroundings = Surroundings(LONG, parameters)
    surroundings.take_map(grid, 0, pose[:2])
    limits = DriveLimits(forward=0.4, backward=0.3, lateral=0.3, yaw=0.5)
    route = Route(np.array((2.0, 0.0, 0.0)), LONG, base_of(limits), parameters)
    assert surroundings.distances is not None  # measured before, so that nothing is new
    route.draw(surroundings)
    route.work(np.array((1.0, 0.0, 0.0)), 1 << 40)
    assert route.left(pose) == math.inf
    for _ in range(40):
        left = route.keep_up(surroundings, pose, 0.05)
    assert left < math.inf


def test_a_robot_off_its_way_is_led_on_across_a_building_while_that_is_drawn_again() -> None:
    grid, goal = building(doors=(14.0, 16.0)), np.array((27.0, 15.0, 0.0))
    surroundings = around(grid, (2.0, 14.0))
    route = Route(goal, ROUND, base_of(DriveLimits()), PlanningParameters())
    route.draw(surroundings)
    while route.is_drawing:
        route.work(np.array((2.0, 14.0, 0.0)))
    route.draw(surroundings)
    for pose in (np.array((2.0, 14.0, 0.0)), np.array((2.0, 10.0, 0.0))):
        route.lead_from(pose)
        assert route.way[0, :2] == pytest.approx(pose[:2], abs=0.1)
        assert route.way[-1, :2] == pytest.approx(goal[:2], abs=0.2)


@for_all('cells', range(368, 376))
def test_the_last_wall_of_a_large_map_is_looked_at_whatever_its_size(cells) -> None:
    grid = Grid(np.zeros((cells, cells), np.int8), 0.05, (0.0, 0.0))
    grid.cells[-1:] = grid.cells[:, -1:] = 100
    end = 0.05 * cells
    looked = around(grid, (end - 0.5, end - 0.5))
    assert looked.is_windowed
    assert (looked.grid.cells[-1] == 100).all()
    assert (looked.grid.cells[:, -1] == 100).all()
