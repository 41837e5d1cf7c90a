# SPDX-License-Identifier: Apache-2.0
"""Flats and the office: sizes, doors that lead everywhere, space at the start."""

import functools

from cases import for_all
from descriptions import robot_named
from mujoco_sim.flats import _corners, make_flat, make_office
from mujoco_sim.world import build_world
import numpy as np
import pytest
from wasd_core.errors import SimulationError

CELL = 0.1
NAMES = ['office', *(f'flat:{seed}' for seed in range(10))]


@functools.cache
def flat_named(name):
    return make_office() if name == 'office' else make_flat(int(name.partition(':')[2]))


in_each = for_all('name', NAMES)


def distances(flat, points):
    """Return how far points, shape (n, 2), are from the nearest box [m], 0 inside."""
    nearest = np.full(len(points), np.inf)
    for x, y, half_length, half_width, _, yaw in flat.boxes:
        along = np.array(((np.cos(yaw), np.sin(yaw)), (-np.sin(yaw), np.cos(yaw))))
        off = np.abs((points - (x, y)) @ along.T) - (half_length, half_width)
        np.minimum(nearest, np.hypot(*np.maximum(off, 0.0).T), out=nearest)
    return nearest


def reached(flat, radius):
    """Return the centres of cells [m], shape (n, 2), to which a disc gets from the origin."""
    counts = np.ceil(flat.size / CELL).astype(int)
    cells = np.stack(np.meshgrid(*map(np.arange, counts), indexing='ij'), axis=-1)
    points = flat.corner + (cells + 0.5) * CELL
    free = (distances(flat, points.reshape(-1, 2)) > radius).reshape(counts)
    known = np.zeros_like(free)
    front = [tuple(((-flat.corner) // CELL).astype(int))]
    while front:
        x, y = front.pop()
        if free[x, y] and not known[x, y]:
            known[x, y] = True
            front += [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
    return points[known]


@pytest.mark.slow
@in_each
def test_every_room_is_reached_through_doors(name):
    flat = flat_named(name)
    found = reached(flat, 0.35)
    for room in flat.rooms:
        inside = ((found > room[:2]) & (found < room[2:])).all(axis=1)
        assert inside.sum() * CELL**2 > 0.5


@pytest.mark.slow
@in_each
def test_there_is_space_at_the_start_and_in_doors(name):
    flat = flat_named(name)
    assert distances(flat, np.zeros((1, 2)))[0] >= 0.6
    assert (flat.doors[:, 2] >= 0.8).all()
    gaps = distances(flat, flat.doors[:, :2])
    np.testing.assert_array_less(np.minimum(0.5 * flat.doors[:, 2], 0.499) - 1e-9, gaps)


@in_each
def test_doors_make_a_loop(name):
    flat = flat_named(name)
    # A tree of rooms has one door less than rooms.
    assert len(flat.doors) >= len(flat.rooms)


@in_each
def test_boxes_stand_inside_and_are_high_enough_to_be_seen(name):
    flat = flat_named(name)
    corners = np.concatenate([_corners(box) for box in flat.boxes]) - flat.corner
    assert (corners >= -1e-9).all()
    assert (corners <= flat.size + 1e-9).all()
    assert (flat.boxes[:, 4] >= 0.5).all()


@pytest.mark.slow
def test_a_flat_has_the_size_of_one():
    for seed in range(10):
        width, length = np.sort(make_flat(seed).size - 0.1)
        assert 8.0 <= width <= 12.0
        assert 10.0 <= length <= 16.0


def test_the_same_seed_gives_the_same_flat_and_another_one_another():
    np.testing.assert_array_equal(make_flat(3).boxes, flat_named('flat:3').boxes)
    assert make_flat(3).boxes.shape != flat_named('flat:4').boxes.shape


@in_each
def test_a_flat_is_not_the_same_turned_around(name):
    flat = flat_named(name)
    # So that a lidar can tell where in it a robot is.
    middle = flat.corner + 0.5 * flat.size
    places = flat.boxes[:, :2]
    turned = 2.0 * middle - places
    off = np.linalg.norm(places[:, None] - turned[None], axis=2).min(axis=1)
    assert (off > 0.1).mean() > 0.7


@pytest.mark.slow
@pytest.mark.parametrize('name', ['flat:3', 'office'])
def test_the_world_has_the_boxes_of_the_flat(name):
    world = build_world(robot_named('mbot'), name)
    for index, box in enumerate(flat_named(name).boxes):
        walls = flat_named(name).walls
        kind = f'wall{index}' if index < walls else f'furniture{index - walls}'
        geom = world.model.geom(kind)
        np.testing.assert_allclose(geom.pos, (box[0], box[1], 0.5 * box[4]))
        np.testing.assert_allclose(2.0 * geom.size, (2.0 * box[2], 2.0 * box[3], box[4]))


def test_a_seed_that_is_no_whole_number_is_said():
    with pytest.raises(SimulationError, match=r'--world flat:3\.5: wanted a whole number'):
        build_world(robot_named('mbot'), 'flat:3.5')
    with pytest.raises(SimulationError, match='--world flat:-1: wanted a number from 0 to 999999'):
        build_world(robot_named('mbot'), 'flat:-1')
