# SPDX-License-Identifier: Apache-2.0
"""A robot that differs at random: within the ranges, by the seed, and really."""

import dataclasses

from mujoco_sim.parameters import Drawn, Untold
from mujoco_sim.robot_setup import draw, randomise, RobotSetup, usual_setup
from mujoco_sim.world import build_world
import numpy as np
import pytest
from robot_description.description import load_robot
from wasd_core.robot_io import JointCommand


@pytest.fixture(scope='module')
def go2():
    return load_robot('go2')


def values(drawn):
    """Return all that was drawn, shape (n,)."""
    rest = [drawn.mass, *drawn.centre, drawn.friction, drawn.command_delay, drawn.sensor_delay]
    return np.array([*rest, drawn.noise, *drawn.strength.values()])


NEUTRAL = np.array([0.0] * 4 + [0.6] + [0.0] * 2 + [1.0] * 13)
LOW = np.array([-1.0] + [-0.05] * 3 + [0.5] + [0.0] * 2 + [1.0] + [0.9] * 12)
HIGH = np.array([3.0] + [0.05] * 3 + [1.25] + [0.004] * 2 + [5.0] + [1.1] * 12)


@pytest.mark.parametrize('level', [0.0, 0.3, 1.0])
def test_ranges_are_as_documented_and_shrink_with_the_level(go2, level):
    drawn = np.array([values(draw(level, seed, go2.quadruped)) for seed in range(300)])
    low, high = NEUTRAL + level * (LOW - NEUTRAL), NEUTRAL + level * (HIGH - NEUTRAL)
    assert (drawn >= low - 1e-12).all()
    assert (drawn <= high + 1e-12).all()
    assert (np.ptp(drawn, axis=0) >= 0.95 * (high - low)).all()


def test_the_seed_decides_and_the_level_only_stretches(go2):
    one, other = (values(draw(1.0, seed, go2.quadruped)) for seed in (1, 2))
    np.testing.assert_array_equal(values(draw(1.0, 1, go2.quadruped)), one)
    assert (one != other).all()
    half = values(draw(0.5, 1, go2.quadruped))
    np.testing.assert_allclose(half - NEUTRAL, 0.5 * (one - NEUTRAL), atol=1e-12)


def test_larger_robots_get_larger_lengths_and_masses(go2):
    b1 = dataclasses.replace(go2.quadruped, mass=4.0 * go2.quadruped.mass)
    assert draw(1.0, 1, b1).mass == pytest.approx(4.0 * draw(1.0, 1, go2.quadruped).mass)


def test_at_level_0_the_setup_is_the_usual_one(go2):
    usual = usual_setup(go2)
    assert randomise(usual, 1, go2) == usual


def test_noise_and_delay_are_on_top_of_the_usual(go2):
    usual = dataclasses.replace(usual_setup(go2), untold=Untold(randomise=1.0))
    setup = randomise(usual, 1, go2)
    drawn = setup.drawn
    assert setup.command_delay == usual.command_delay + drawn.command_delay
    assert setup.noise.acceleration == drawn.noise * usual.noise.acceleration


def build(go2, drawn, **more):
    setup = RobotSetup(height=5.0, imu=True, drawn=drawn, **more)
    return build_world(go2, setup=setup)


def test_mass_and_centre_of_the_base_are_changed_and_its_links_are_not(go2):
    usual, other = build(go2, Drawn()), build(go2, Drawn(mass=2.0, centre=(0.03, -0.02, 0.01)))
    root = usual.root
    assert other.model.body_mass[root] == pytest.approx(usual.model.body_mass[root] + 2.0)
    moved = other.model.body_ipos[root] - usual.model.body_ipos[root]
    np.testing.assert_allclose(moved, (0.03, -0.02, 0.01), atol=1e-12)
    assert other.model.body_subtreemass[0] == pytest.approx(usual.model.body_subtreemass[0] + 2.0)
    links = slice(root + 1, None)
    np.testing.assert_array_equal(other.model.body_mass[links], usual.model.body_mass[links])


def test_feet_have_the_friction_drawn_unless_another_is_asked_for(go2):
    foot = 'FL_foot/0'
    assert build(go2, Drawn(friction=0.9)).model.geom(foot).friction[0] == 0.9
    asked = build(go2, Drawn(friction=0.9), untold=Untold(friction=0.3))
    assert asked.model.geom(foot).friction[0] == 0.3


def test_a_weak_motor_turns_less_and_believes_what_it_was_told(go2):
    name = go2.quadruped.joint_names[0]
    world = build(go2, Drawn(strength={name: 0.9}))
    told = np.zeros((5, 12))
    told[2] = 3.0
    world.apply(JointCommand(*told))
    world.step()
    motor = world.motor_names.index(name)
    real = world.joints().effort[world.parts.motor_joint]
    np.testing.assert_allclose(real[motor], 2.7, rtol=1e-12)
    np.testing.assert_allclose(np.delete(real, motor), 3.0, rtol=1e-12)
    np.testing.assert_allclose(world.read().joints.effort[world.parts.motor_joint], 3.0)


@pytest.mark.parametrize('milliseconds', [2, 4])
def test_sensors_tell_of_a_while_ago(go2, milliseconds):
    world = build(go2, Drawn(sensor_delay=1e-3 * milliseconds))
    true, seen = [], []
    for _ in range(6):
        true.append(world.joints().position.copy())
        seen.append(world.read().joints.position.copy())
        world.step(2)
    late = milliseconds // 2
    np.testing.assert_array_equal(seen[late:], true[: len(true) - late])
    world.reset()
    np.testing.assert_array_equal(world.read().joints.position, true[0])
