# SPDX-License-Identifier: Apache-2.0
"""Heights become free and occupied cells; stairs are no obstacle to who climbs them, walls are."""

import math

from cases import for_all
import numpy as np
import pytest
from wasd_core.rotations import Pose, rpy_matrix
from wasd_navigation.records import FREE, Grid, OCCUPIED, read_scan, UNKNOWN
from wasd_navigation.se2 import inverse, transform
from wasd_navigation.steps import judge
from wasd_navigation.traversability import Traversability

CELL, COUNT, CLIMB = 0.04, 100, 0.17
CORNER = np.array((-1.0, -2.0))
STILL = np.zeros(3)
LIDAR = 0.43  # how high a planar lidar is [m]


def heights_of(profile):
    """Return heights on a square whose height at x [m] is given by a function, NaN: unknown."""
    x = CORNER[0] + CELL * (np.arange(COUNT) + 0.5)
    return np.tile([profile(value) for value in x], (COUNT, 1))


def stairs(rise, seen=math.inf):
    """Return six steps from x = 0.8 on, seen up to x."""
    return lambda x: (
        math.nan if x > seen else rise * min(max(math.floor((x - 0.8) / 0.3) + 1, 0), 6)
    )


def ground_of(profile, correction=STILL, floor=0.0):
    ground = Traversability(CLIMB)
    ground.take(heights_of(profile), CORNER, CELL, floor, correction, 0.05)
    return ground


def flat(x):
    """Return the height of a floor that is seen all around."""
    return 0.0


def rays(*ends):
    """Return rays from the base to ends (x, y, z)."""
    return np.zeros((len(ends), 2)), np.array(ends, float)


@for_all(('rise', 'kind'), [(0.15, FREE), (0.25, OCCUPIED)])
def test_steps_up_to_the_height_that_it_climbs_are_free(rise, kind):
    judged = judge(heights_of(stairs(rise)), CELL, CLIMB)
    edge = round((0.8 - CORNER[0]) / CELL)
    assert (judged[:, edge] == kind).all()
    assert (judged[:, :edge] == FREE).all()


@for_all('sign', [1.0, -1.0])
@for_all('axis', [0, 1])
def test_the_edge_before_a_drop_is_occupied_whichever_way_it_lies(sign, axis):
    heights = heights_of(lambda x: -0.9 if sign * x > 0.5 else 0.0)
    judged = judge(heights.T if axis else heights, CELL, CLIMB)
    assert (judged == OCCUPIED).sum() == COUNT
    assert ((heights.T if axis else heights)[judged == OCCUPIED] == 0.0).all()


def test_the_edge_of_what_it_hides_is_occupied_where_that_is_too_steep_for_stairs():
    def cliff(x):
        return 0.9 if x < 0.5 else 0.0 if x > 1.0 else math.nan

    def hidden_tread(x):
        return 0.0 if x < 0.5 else 0.3 if x > 0.8 else math.nan

    judged = judge(heights_of(cliff), CELL, CLIMB)
    edge = math.ceil((0.5 - CORNER[0]) / CELL - 0.5) - 1
    assert (judged[:, edge] == OCCUPIED).all()
    assert (judged == OCCUPIED).sum() == COUNT
    assert not (judge(heights_of(hidden_tread), CELL, CLIMB) == OCCUPIED).any()


def test_single_wrong_heights_are_no_obstacle():
    heights = heights_of(flat)
    heights[30, 40] = 0.5
    assert (judge(heights, CELL, CLIMB) == FREE).all()
    heights[30:33, 40:43] = 0.5
    assert (judge(heights, CELL, CLIMB) == OCCUPIED).sum() == 8  # around its middle


def test_what_is_seen_at_a_wall_of_the_map_does_not_make_it_thicker():
    grid = map_of(FREE)
    grid.cells[:, grid.to_cells(np.array(((0.9, 0.0),)))[0, 1]] = OCCUPIED
    front = heights_of(lambda x: 0.4 if 0.82 < x < 0.9 else 0.0)
    ground = Traversability(CLIMB)
    ground.take(front, CORNER, CELL, 0.0, STILL, 0.05)
    assert np.array_equal(ground.over(grid).cells, grid.cells)
    assert (ground.over(map_of(FREE)).cells == OCCUPIED).any()


def test_where_nothing_is_seen_nothing_is_known():
    heights = heights_of(lambda x: math.nan)
    assert (judge(heights, CELL, CLIMB) == UNKNOWN).all()


def map_of(kind):
    """Return a map of 8 x 8 m in which all cells are of a kind."""
    return Grid(np.full((160, 160), kind, np.int8), 0.05, (-4.0, -4.0))


def cells_at(grid, *places):
    return [int(grid.cells[tuple(cell)]) for cell in grid.to_cells(np.array(places, float))]


def test_risers_that_the_lidar_took_for_walls_are_cleared_and_walls_on_even_ground_are_not():
    grid = map_of(UNKNOWN)
    for x in (0.0, 1.4):  # a wall where the ground is even; the third riser
        grid.cells[:, grid.to_cells(np.array(((x, 0.0),)))[0, 1]] = OCCUPIED
    merged = ground_of(stairs(0.15)).over(grid)
    assert cells_at(merged, (0.0, 0.5), (1.4, 0.5), (1.1, 0.0)) == [OCCUPIED, FREE, FREE]
    assert cells_at(merged, (3.5, 0.0), (1.4, 3.5)) == [UNKNOWN, OCCUPIED]  # beyond the heights
    assert grid.cells[0, 0] == UNKNOWN  # what was given is left as it is
    assert cells_at(grid, (1.1, 0.0)) == [UNKNOWN]


def test_a_step_that_is_too_high_is_occupied_also_where_the_map_is_free():
    merged = ground_of(stairs(0.25)).over(map_of(FREE))
    assert cells_at(merged, (0.825, 0.0)) == [OCCUPIED]
    assert cells_at(merged, (0.5, 0.0)) == [FREE]


@for_all('correction', [(0.0, 0.0, 1.0), (0.7, -0.4, -2.5)])
def test_cells_lie_in_the_frame_of_the_map(correction):
    correction = np.array(correction)
    merged = ground_of(stairs(0.25), correction).over(map_of(FREE))
    wrong = np.argwhere(merged.cells == OCCUPIED)
    x = transform(inverse(correction), merged.to_points(wrong))[:, 0]
    # Each of the six risers, and no other place.
    off = np.abs(x[:, None] - (0.8 + 0.3 * np.arange(6)))
    assert (off.min(axis=1) < 0.08).all()
    assert set(off.argmin(axis=1)) == set(range(6))


def test_ground_that_was_left_behind_is_remembered_until_it_is_seen_to_be_otherwise():
    ground = ground_of(stairs(0.25))
    there = tuple(ground.over(map_of(FREE)).to_cells(np.array(((0.825, 0.0),)))[0])
    assert ground.over(map_of(FREE)).cells[there] == OCCUPIED
    nothing = np.full((COUNT, COUNT), np.nan)
    ground.take(nothing, CORNER + (10.0, 0.0), CELL, 0.0, STILL, 0.05)
    assert ground.over(map_of(FREE)).cells[there] == OCCUPIED
    ground.take(heights_of(flat), CORNER, CELL, 0.0, STILL, 0.05)
    assert not (ground.over(map_of(FREE)).cells == OCCUPIED).any()
    ground.reset()
    grid = map_of(UNKNOWN)
    assert ground.over(grid) is grid


def test_rays_that_end_on_stairs_end_on_ground_also_on_a_riser_that_is_not_seen_from_above():
    from_below = ground_of(stairs(0.15, seen=1.1))
    assert from_below.is_ground(*rays((1.4, 0.0, LIDAR), (0.9, 0.0, 0.1))).all()
    from_above = ground_of(stairs(0.15))
    assert from_above.is_ground(*rays((1.4, 0.0, LIDAR), (1.38, 0.5, 0.4))).all()


def test_walls_and_legs_of_tables_are_no_ground():
    assert not ground_of(flat).is_ground(*rays((1.5, 0.0, LIDAR), (0.3, 1.0, 0.1))).any()
    # A wall of which some points are mapped as if they were ground, too.
    foot = ground_of(lambda x: 0.0 if x < 1.4 else 0.4 if x < 1.5 else math.nan)
    assert not foot.is_ground(*rays((1.45, 0.0, LIDAR), (1.6, 0.3, LIDAR))).any()
    # One right behind a curb, too, and one far above stairs that are not seen to their end.
    curb = ground_of(lambda x: 0.15 if x > 0.8 else 0.0)
    assert not curb.is_ground(*rays((1.3, 0.0, LIDAR))).any()
    assert not ground_of(stairs(0.15, seen=1.1)).is_ground(*rays((1.4, 0.0, 1.0))).any()


def test_where_nothing_is_seen_only_what_is_below_the_feet_is_ground():
    blank = ground_of(lambda x: math.nan, floor=0.6)
    assert blank.is_ground(*rays((1.5, 0.0, 0.5), (1.5, 0.0, 1.0))).tolist() == [True, False]
    never = Traversability(CLIMB)
    assert not never.is_ground(*rays((1.5, 0.0, -0.5), (1.5, 0.0, 1.0))).any()


def test_a_scan_leaves_out_rays_that_end_on_ground():
    mount = Pose(np.array([0.0, 0.0, LIDAR]), rpy_matrix(0.0, 0.0, 0.0))
    ranges, angles = np.array((1.4, 1.4, 9.0)), np.array((0.0, math.pi, 0.2))
    is_ground = ground_of(stairs(0.15, seen=1.1)).is_ground
    scan = read_scan(ranges, angles, (0.1, 6.0), mount, None, is_ground)
    assert scan.points == pytest.approx(np.array(((-1.4, 0.0),)))
    assert len(scan.ends) == 2  # and the ray that hits nothing


VELOCITY = np.array((0.3, 0.1, 0.2))


def way_to(x, y):
    """Return a straight path from the origin."""
    return np.linspace(0.0, 1.0, 30)[:, None] * (x, y)


def test_on_even_ground_and_on_ramps_it_moves_as_it_likes():
    for profile in (flat, lambda x: 0.3 * x):
        moved = ground_of(profile).straighten(VELOCITY, STILL, way_to(1.5, 0.5))
        assert moved.tolist() == VELOCITY.tolist()


def test_before_stairs_it_turns_along_them_and_then_goes_straight():
    ground = ground_of(stairs(0.15))
    askew = np.array((0.4, 0.0, 0.6))
    vx, vy, wz = ground.straighten(VELOCITY, askew, way_to(1.5, 0.5) + (0.4, 0.0))
    assert (vx, vy) == (0.0, 0.0)
    assert wz < 0.0
    vx, vy, wz = ground.straighten(VELOCITY, askew * (1, 1, 0), way_to(1.5, 0.5) + (0.4, 0.0))
    # Cells around a place lie not quite evenly around it.
    assert (vx, vy) == (pytest.approx(math.hypot(*VELOCITY[:2]), rel=0.05), 0.0)
    assert abs(wz) < 0.03


def test_down_stairs_it_looks_down():
    ground = ground_of(stairs(0.15))
    pose = np.array((1.55, 0.0, math.pi))
    vx, _, wz = ground.straighten(VELOCITY, pose, way_to(-1.5, 0.3) + (1.55, 0.0))
    assert vx == pytest.approx(math.hypot(*VELOCITY[:2]), rel=0.02)
    assert abs(wz) < 0.03


@for_all('yaw', [0.0, math.pi])
def test_a_way_along_a_tread_is_left_for_the_way_that_it_looks(yaw):
    ground = ground_of(stairs(0.15))
    pose = np.array((1.55, 0.0, yaw))
    vx, vy, wz = ground.straighten(VELOCITY, pose, way_to(0.0, 1.5) + (1.55, 0.0))
    assert vx > 0.0
    assert (vy, abs(wz) < 0.02) == (0.0, True)


def test_a_turn_on_the_spot_and_a_goal_without_a_way_are_left_alone():
    ground = ground_of(stairs(0.15))
    turn = np.array((0.0, 0.0, 0.5))
    assert ground.straighten(turn, STILL, way_to(1.5, 0.0)).tolist() == turn.tolist()
    assert ground.straighten(VELOCITY, STILL, np.empty((0, 2))).tolist() == VELOCITY.tolist()
