# SPDX-License-Identifier: Apache-2.0
"""Goals that cannot be are refused in the first step, with the reason, wherever they lie."""

from cases import for_all
import numpy as np
import pytest
from wasd_navigation.parameters import DriveLimits, Footprint
from wasd_navigation.planning.driver import Driver
from wasd_navigation.records import Grid

# Four metres square, free, with nothing known of the last.
CELLS = np.zeros((80, 80), np.int8)
CELLS[:, 60:] = -1


@for_all(
    ('x', 'y', 'words'),
    [
        (9.0, 0.0, 'outside the map'),
        (-1e300, 0.0, 'outside the map'),
        (1.5, 0.0, 'is unknown'),
    ],
)
def test_a_goal_that_is_not_on_the_map_is_refused_with_the_reason(x, y, words):
    driver = Driver(DriveLimits(), Footprint(radius=0.2))
    driver.set_goal(np.array([x, y, 0.0]))
    grid = Grid(CELLS, 0.05, (-2.0, -2.0))
    velocity = driver.step(grid, 1, np.zeros(3), np.zeros(3), None, 0.05)
    assert velocity == pytest.approx(0.0)
    assert driver.state == 'refused'
    assert words in driver.reason


@for_all('shape', [(0, 0), (1, 1), (1, 50), (50, 1), (2, 2)])
@for_all('sizes', [{'radius': 0.15}, {'half_length': 0.34, 'half_width': 0.164}])
def test_a_map_of_next_to_nothing_is_none(shape, sizes):
    driver = Driver(DriveLimits(), Footprint(**sizes))
    driver.set_goal(np.zeros(3))
    grid = Grid(np.zeros(shape, np.int8), 0.05, (-0.01, -0.01))
    velocity = driver.step(grid, 1, np.zeros(3), np.zeros(3), None, 0.05)
    assert velocity == pytest.approx(0.0)
    assert driver.reason == 'there is no map yet: drive around first, or give one'


@pytest.mark.slow
@pytest.mark.parametrize('room', [0.0, 0.02])
def test_beside_a_wall_a_long_robot_is_not_said_to_have_a_way_through_a_closed_door(room):
    corridor = np.zeros((26, 120), np.int8)
    corridor[:1] = corridor[-1:] = corridor[:, :1] = corridor[:, -1:] = 100
    closed = corridor.copy()
    closed[:, 60] = 100  # by a door of one cell
    footprint = Footprint(half_length=0.34, half_width=0.164)
    driver = Driver(DriveLimits(lateral=0.3), footprint)
    driver.set_goal(np.array([4.5, 0.6, 0.0]))
    pose = np.array([1.5, 0.05 + footprint.half_width + room, 0.0])
    states = []
    for step in range(40):
        grid = Grid(corridor if step < 20 else closed, 0.05, (0.0, 0.0))
        driver.step(grid, step // 20, pose, np.zeros(3), None, 0.05)
        states.append(driver.state)
    assert states[19] == 'driving'
    assert states[-1] == 'recovering'
    assert driver.reason == 'no way leads to (4.50, 0.60): it is shut off: waiting'


@pytest.mark.slow
@pytest.mark.parametrize('yaw', [0.0, 0.2, -0.2])
def test_a_long_robot_beside_a_wall_finds_out_of_where_it_may_not_be(yaw):
    cells = np.zeros((40, 120), np.int8)
    cells[:1] = cells[-1:] = cells[:, :1] = cells[:, -1:] = 100
    footprint = Footprint(half_length=0.34, half_width=0.164)
    driver = Driver(DriveLimits(lateral=0.3), footprint)
    driver.set_goal(np.array([4.5, 1.0, 0.0]))
    side = footprint.half_width * np.cos(yaw) + footprint.half_length * abs(np.sin(yaw))
    pose = np.array([1.5, 0.05 + side + 0.005, yaw])
    for _ in range(40):
        velocity = driver.step(Grid(cells, 0.05, (0.0, 0.0)), 1, pose, np.zeros(3), None, 0.05)
    assert driver.state == 'driving'
    assert velocity.any()
