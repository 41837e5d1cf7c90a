# SPDX-License-Identifier: Apache-2.0
"""Keepout areas are planned with as obstacles, but a robot that stands inside finds out."""

from cases import for_all
from navigation_stand_ins import odometry, scan, StandInLocator, StandInPilot
import numpy as np
import pytest
from wasd_navigation.keepout import KEEPOUT, Keepout
from wasd_navigation.parameters import DriveLimits, Footprint
from wasd_navigation.planning.distances import measure_distances
from wasd_navigation.planning.driver import Driver
from wasd_navigation.records import FREE, Grid, OCCUPIED, OPENED, UNKNOWN
from wasd_navigation.robot_navigator import RobotNavigator

ROUND = Footprint(radius=0.2)


def grid(rows=100, columns=120, resolution=0.05, origin=(-3.0, -2.5)):
    return Grid(np.full((rows, columns), FREE, np.int8), resolution, origin)


def mask(low, high, **size):
    """Return a mask with one area, from one corner to the other [m]."""
    made = grid(**size)
    rows, columns = np.indices(made.cells.shape)
    points = made.to_points(np.column_stack((rows.ravel(), columns.ravel())))
    inside = ((points >= low) & (points <= high)).all(axis=1).reshape(made.cells.shape)
    made.cells[inside] = OCCUPIED
    return made


BAND = mask((0.5, -1.0), (1.0, 2.5))


@for_all(('resolution', 'count'), [(0.05, 1), (0.0125, 4), (0.2, 0.25)])
def test_cells_are_kept_out_of_whatever_the_sizes_of_both(resolution, count):
    area = mask(
        (0.5, -1.0), (1.0, 1.0), rows=round(100 * count), columns=round(120 * count),
        resolution=resolution,
    )  # fmt: skip
    kept = Keepout(area, ROUND).on(grid())
    size = kept.sum() * 0.05**2
    assert size == pytest.approx((area.cells == OCCUPIED).sum() * resolution**2, rel=0.15)
    assert kept[70 - 20, 75]
    assert not kept[50, 60]


def test_one_thin_line_of_a_fine_mask_is_not_lost():
    line = Grid(np.full((400, 480), FREE, np.int8), 0.0125, (-3.0, -2.5))
    line.cells[:, 241] = OCCUPIED
    assert Keepout(line, ROUND).on(grid()).any(axis=1).all()


def test_what_is_applied_is_an_obstacle_and_the_rest_is_as_it_was():
    before = grid()
    before.cells[:10] = UNKNOWN
    keepout = Keepout(BAND, ROUND)
    applied = keepout.applied(before, np.zeros(3))
    kept = keepout.on(before)
    assert (applied.cells[kept] == OCCUPIED).all()
    assert (applied.cells[~kept] == before.cells[~kept]).all()
    assert (before.cells != OCCUPIED).all()


def test_a_mask_beside_the_map_changes_nothing():
    before = grid()
    far = Keepout(mask((0.5, -1.0), (1.0, 1.0), origin=(50.0, 50.0)), ROUND)
    assert far.applied(before, np.zeros(3)) is before


@for_all('footprint', [ROUND, Footprint(half_length=0.34, half_width=0.164)])
def test_a_robot_inside_has_a_way_out_and_only_there(footprint):
    area = mask((-1.5, -1.5), (2.0, 1.5))
    keepout, pose = Keepout(area, footprint), np.array([1.4, 0.0, 0.0])
    assert keepout.overlaps(pose)
    free = keepout.applied(grid(), pose)
    distances = measure_distances(free.cells == OCCUPIED, free.resolution)
    # Straight on to the nearest edge, at x = 2, it has room all the way.
    for x in np.arange(1.4, 2.6, 0.05):
        row, column = free.to_cells(np.array([[x, 0.0]]))[0]
        assert distances[row, column] > footprint.inscribed, x
    row, column = free.to_cells(np.array([[-0.6, 0.0]]))[0]
    assert free.cells[row, column] == OCCUPIED


def test_the_way_out_does_not_lead_through_a_wall():
    known = grid()
    wall = known.to_cells(np.array([[2.2, 0.0]]))[0, 1]
    known.cells[:, wall : wall + 2] = OCCUPIED
    keepout = Keepout(mask((0.5, -1.5), (2.0, 1.5)), ROUND)
    free = keepout.applied(known, np.array([1.7, 0.0, 0.0]))
    assert (free.cells[:, wall : wall + 2] == OCCUPIED).all()
    # The nearest place with room on its side is beyond y = 1.5 or x = 0.5, not at the wall.
    row, column = free.to_cells(np.array([[0.6, 0.0]]))[0]
    opened = free.cells[row, column] == OPENED
    up = free.to_cells(np.array([[1.5, 1.4]]))[0]
    assert opened or free.cells[tuple(up)] == OPENED


@for_all('footprint', [ROUND, Footprint(half_length=0.34, half_width=0.164)])
def test_a_robot_inside_aims_at_places_where_no_part_of_it_is_inside(footprint):
    keepout, pose = Keepout(mask((-0.75, -0.5), (0.75, 0.5)), footprint), np.zeros(3)
    driver = Driver(DriveLimits(), footprint)
    driver.set_goal(np.array([0.3, -0.65, 0.0]))
    driver.step(keepout.applied(grid(), pose), 1, pose, pose, None, 0.05)
    assert driver.state == 'driving'
    assert not keepout.overlaps(driver.goal)
    assert np.hypot(*(driver.goal[:2] - (0.3, -0.65))) < 0.15


def test_where_no_place_outside_is_known_all_is_open():
    known = grid()
    applied = Keepout(mask((-9.0, -9.0), (9.0, 9.0)), ROUND).applied(known, np.zeros(3))
    assert (applied.cells == FREE).all()


def test_exploring_ends_where_the_robot_has_left_the_area_around_its_start():
    locator = StandInLocator()
    locator.grows, locator.correction = True, np.zeros(3)
    unit = RobotNavigator(parts=(locator, StandInPilot()))
    unit.navigator.keepout = Keepout(mask((-0.5, -0.5), (0.5, 0.5)), ROUND)
    frontiers = iter([np.array([1.5, 0.0, 0.0])] * 6)
    for tick in range(40):
        here = odometry(x=0.05 * tick)
        unit.navigator.move(here)
        unit.navigator.see(scan(), here)
        if tick == 0:
            unit.explore()
            unit.explorer.choose = lambda grid, pose, home: next(frontiers, None)
            unit.explorer.is_seen = lambda grid, pose: False
        unit.step(0.05 * tick)
    assert not unit.is_exploring
    assert unit.navigator.last_goal == pytest.approx((0.75, 0.0, 0.0))


def test_a_robot_that_passes_by_an_area_does_not_overlap_it():
    keepout = Keepout(BAND, ROUND)
    assert not keepout.overlaps(np.array([0.29, 0.0, 0.0]))
    assert keepout.overlaps(np.array([0.32, 0.0, 0.0]))
    long = Keepout(BAND, Footprint(half_length=0.34, half_width=0.164))
    assert long.overlaps(np.array([0.2, 0.0, 0.0]))
    assert not long.overlaps(np.array([0.2, 0.0, np.pi / 2.0]))


def test_places_are_inside_or_not():
    keepout = Keepout(BAND, ROUND)
    assert keepout.has(np.array([0.75, 0.0]))
    assert not keepout.has(np.array([0.0, 0.0]))
    assert not keepout.has(np.array([99.0, 0.0]))
    assert not keepout.has(np.array([np.nan, 0.0]))


def test_a_picture_shows_areas_but_no_wall_as_one():
    known = grid()
    known.cells[50, 75] = OCCUPIED
    shown = Keepout(BAND, ROUND).shown_on(known)
    assert shown.cells[50, 76] == KEEPOUT
    assert shown.cells[50, 75] == OCCUPIED
