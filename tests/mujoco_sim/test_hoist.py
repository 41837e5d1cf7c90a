# SPDX-License-Identifier: Apache-2.0
"""A hoist bears what it holds, raises what lies, and is gone once it lets go."""

from mujoco_sim.hoist import ABOVE, FREQUENCY, Hoist, LIFT, RAISING_SPEED
from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.world import build_world
import numpy as np
import pytest
from robot_description.description import parse_description
from wasd_core.robot_io import GRAVITY

HEIGHT, MASS = 1.0, 8.0
BODY = f"""
<robot name="body"><link name="body"><inertial><mass value="{MASS}"/>
  <inertia ixx="0.3" iyy="0.3" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="0.2 0.3 0.6"/></geometry></collision></link></robot>
"""


@pytest.fixture
def held(tmp_path):
    """A body that hangs, and its hoist."""
    loaded = parse_description(BODY, tmp_path / 'body.urdf')
    world = build_world(loaded, setup=RobotSetup(height=HEIGHT))
    return world, Hoist(world)


def run(world, hoist, seconds):
    for _ in range(round(seconds / 0.002)):
        hoist.step(0.002)
        world.step(2)


def test_what_it_holds_stays_where_it_is_by_its_weight(held):
    world, hoist = held
    run(world, hoist, 2.0)
    np.testing.assert_allclose(world.base().position, (0.0, 0.0, HEIGHT), atol=1e-6)
    wrench = world.data.xfrc_applied[world.root]
    np.testing.assert_allclose(wrench, (0, 0, MASS * GRAVITY, 0, 0, 0), atol=1e-6)


def test_a_force_moves_it_as_far_as_its_springs_say(held):
    world, hoist = held
    force = 20.0
    world.keep_pushing((0.0, 0.0, -force))
    run(world, hoist, 4.0)
    sunk = HEIGHT - world.base().position[2]
    assert sunk == pytest.approx(force / (MASS * FREQUENCY**2), rel=1e-3)
    world.keep_pushing(np.zeros(3))
    run(world, hoist, 4.0)
    assert world.base().position[2] == pytest.approx(HEIGHT, abs=1e-4)


def test_pushed_aside_it_swings_back_upright(held):
    world, hoist = held
    world.push((40.0, 25.0, 0.0), 0.2, (0.0, 0.0, -0.3))
    run(world, hoist, 0.3)
    assert world.base().tilt > 0.03
    run(world, hoist, 6.0)
    assert world.base().tilt < 0.005
    np.testing.assert_allclose(world.base().position, (0.0, 0.0, HEIGHT), atol=2e-3)


def test_let_go_it_falls_freely(held):
    world, hoist = held
    run(world, hoist, 0.5)
    hoist.let_go()
    assert not world.data.xfrc_applied.any()
    run(world, hoist, 0.3)
    fallen = HEIGHT - world.base().position[2]
    assert fallen == pytest.approx(0.5 * GRAVITY * 0.3**2, rel=0.01)


def test_what_lies_on_its_side_is_raised_and_turned_upright_slowly(held):
    world, hoist = held
    hoist.let_go()
    world.push((0.0, 60.0, 0.0), 0.3, (0.0, 0.0, 0.5))
    run(world, hoist, 4.0)
    low = world.base()
    assert low.tilt > 1.0
    hoist.take()
    fastest = 0.0
    for _ in range(60):
        run(world, hoist, 0.1)
        fastest = max(fastest, float(world.base().linear_velocity[2]))
    base = world.base()
    assert base.tilt < 0.02
    assert base.position[2] == pytest.approx((1.0 + LIFT) * HEIGHT, abs=0.01)
    np.testing.assert_allclose(base.position[:2], low.position[:2], atol=ABOVE * HEIGHT + 0.1)
    assert fastest < 3.0 * RAISING_SPEED


def test_after_a_reset_it_holds_at_the_start_again(held):
    world, hoist = held
    hoist.let_go()
    run(world, hoist, 1.0)
    world.reset()
    hoist.reset()
    assert hoist.is_on
    run(world, hoist, 1.0)
    np.testing.assert_allclose(world.base().position, (0.0, 0.0, HEIGHT), atol=1e-6)
