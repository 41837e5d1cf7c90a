# SPDX-License-Identifier: Apache-2.0
import math

from descriptions import robot_named
from mujoco_sim.world import build_world, place_robot, PlanarPose
import numpy as np
import pytest


@pytest.fixture
def world():
    world = build_world(robot_named('mbot'))
    world.actuation.is_kinematic = True
    return world


def test_the_robot_is_where_it_is_put_and_stays_there(world):
    place_robot(
        world, PlanarPose(1.0, -2.0, 0.5, 0.3, 0.1, -0.7), {'left_wheel_joint': (4.0, 5.0)}
    )
    world.step(50)
    base = world.base()
    np.testing.assert_array_equal(base.position[:2], [1.0, -2.0])
    np.testing.assert_allclose(base.rpy, [0.0, 0.0, 0.5], atol=1e-12)
    np.testing.assert_allclose(base.planar_velocity, [0.3, 0.1, -0.7], atol=1e-12)
    joint = world.joint_names.index('left_wheel_joint')
    assert world.joints().position[joint] == 4.0
    assert world.joints().velocity[joint] == 5.0


def test_time_goes_on_without_physics(world):
    world.step(50)
    assert world.time == pytest.approx(0.05)


def test_its_links_are_drawn_where_it_is(world):
    place_robot(world, PlanarPose(1.0, 0.0, math.pi / 2, 0.0, 0.0, 0.0), {})
    wheel = world.data.body('left_wheel_link').xpos
    np.testing.assert_allclose(wheel[:2], [1.0 - 0.19, 0.0], atol=1e-12)
