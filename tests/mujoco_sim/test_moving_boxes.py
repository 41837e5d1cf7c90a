# SPDX-License-Identifier: Apache-2.0
"""Boxes that are put into a robot's way while it drives."""

import math

from contacts import touched
from descriptions import robot_named
from mujoco_sim.parameters import BoxSize
from mujoco_sim.sensors.lidar import Lidar
from mujoco_sim.sensors.mount import Site
from mujoco_sim.sensors.table import read_sensor_tags
from mujoco_sim.world import build_world
import numpy as np
import pytest

BOXES = (BoxSize(0.4, 0.2, 0.7), BoxSize())


@pytest.fixture
def world():
    return build_world(robot_named('mbot'), boxes=BOXES)


def ranges(world):
    robot = robot_named('mbot').robot
    ((tag,), *_), _ = read_sensor_tags(robot)
    lidar = Lidar(tag, Site(world, robot))
    return lambda: lidar.true_ranges()


def test_a_box_is_seen_where_it_was_put_and_no_more_when_it_is_gone(world):
    look = ranges(world)
    assert np.isinf(look()).all()
    assert world.physics.boxes.put(0, 1.0, 0.0, math.pi / 2)
    # In the same instant: nothing has moved but the box, turned by a quarter.
    assert look()[180] == pytest.approx(1.0 - 0.1, abs=1e-3)
    assert world.physics.boxes.put(0, 2.0, 0.0)
    assert look()[180] == pytest.approx(2.0 - 0.2, abs=1e-3)
    assert world.physics.boxes.put(0, 99.0, 0.0)
    assert np.isinf(look()).all()


def test_a_robot_runs_into_a_box_and_does_not_move_it(world):
    assert len(world.physics.boxes) == 2
    assert world.physics.boxes.put(1, 0.45, 0.0)
    world.step(50)
    assert touched(world) == {'floor'}
    world.push((60.0, 0.0, 0.0), 1.0)
    world.step(500)
    assert touched(world) == {'floor', 'moving/box1'}
    assert world.base().position[0] < 0.45
    np.testing.assert_allclose(world.data.body('moving/box1').xpos, (0.45, 0.0, 0.0))


@pytest.mark.parametrize('place', [(0.1, 0.1), (math.nan, 1.0)])
def test_a_box_is_not_put_where_the_robot_is_nor_nowhere_in_particular(world, place):
    assert world.physics.boxes.put(0, 3.0, 3.0)
    before = world.data.mocap_pos.copy(), world.data.qpos.copy()
    assert not world.physics.boxes.put(0, *place)
    np.testing.assert_array_equal(world.data.mocap_pos, before[0])
    np.testing.assert_array_equal(world.data.qpos, before[1])


def test_a_reset_takes_the_boxes_away(world):
    start = world.data.mocap_pos.copy()
    world.physics.boxes.put(0, 1.0, 2.0)
    assert (world.data.mocap_pos != start).any()
    world.reset()
    np.testing.assert_array_equal(world.data.mocap_pos, start)


def test_boxes_that_stand_nowhere_change_nothing(world):
    bare = build_world(robot_named('mbot'))
    assert len(bare.physics.boxes) == 0
    for each in (bare, world):
        each.push((10.0, 3.0, 0.0), 0.2)
        each.step(300)
    np.testing.assert_array_equal(bare.data.qpos, world.data.qpos)
