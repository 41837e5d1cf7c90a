# SPDX-License-Identifier: Apache-2.0
"""Friction: of the feet on any floor, and of a patch of ice under any foot."""

import dataclasses

import mujoco
from mujoco_sim.parameters import Untold, WORLD_NAMES
from mujoco_sim.robot_setup import usual_setup
from mujoco_sim.scene import EDGE, ICE_AHEAD, ICE_LENGTH, PIT, TERRAINS, WORLDS
from mujoco_sim.world import build_world
import numpy as np
import pytest
from robot_description.description import load_robot


@pytest.fixture(scope='module')
def go2():
    return load_robot('go2')


def test_the_help_names_every_world():
    named = [word.partition(':')[0] for word in WORLD_NAMES.split(', ')]
    assert named == [*WORLDS, *TERRAINS]


def contacts(description, friction, world='flat', x=0.0):
    """Return the sliding frictions with the ground, by link, of a robot that lies at x."""
    setup = dataclasses.replace(
        usual_setup(description), untold=Untold(friction=friction), place=(x, 0.0)
    )
    lying = build_world(description, world, setup=setup)
    found = {}
    for _ in range(200):
        lying.step()
        for contact in (lying.data.contact[index] for index in range(lying.data.ncon)):
            own = [geom for geom in contact.geom if lying.model.geom_bodyid[geom] > 0]
            friction = round(float(contact.friction[0]), 9)
            found.setdefault(lying.parts.link_of_geom[own[0]], set()).add(friction)
    return found


@pytest.mark.slow
@pytest.mark.parametrize('friction', [0.1, 0.25, 1.2])
def test_feet_have_the_friction_asked_for_and_other_links_their_own(go2, friction):
    found = contacts(go2, friction)
    feet = {link: found[link] for link in found if link in go2.quadruped.feet}
    assert feet == dict.fromkeys(go2.quadruped.feet, {friction})
    usual = contacts(go2, None)
    assert {link: usual[link] for link in feet} == dict.fromkeys(feet, {0.6})


@pytest.mark.slow
def test_on_ice_everything_slides_whatever_its_own_friction(go2):
    middle = ICE_AHEAD + EDGE + 1.0
    for friction in (None, 1.0):
        assert set().union(*contacts(go2, friction, 'ice:0.1', middle).values()) == {0.1}
        assert contacts(go2, friction, 'ice:0.1')['FL_foot'] == {friction or 0.6}
        beyond = ICE_AHEAD + EDGE + ICE_LENGTH + 1.0
        assert contacts(go2, friction, 'ice:0.1', beyond)['FL_foot'] == {friction or 0.6}


def test_wheels_have_the_friction_asked_for_and_casters_none():
    found = contacts(load_robot('mbot'), 0.2)
    wheels = {link: value for link, value in found.items() if 'wheel' in link}
    assert wheels
    assert set().union(*wheels.values()) == {0.2}


def top(world, x):
    distance = mujoco.mj_ray(
        world.model, world.data, np.array((x, 1.0, 5.0)), np.array((0.0, 0.0, -1.0)), None, 1, -1,
        np.zeros(1, np.int32),
    )  # fmt: skip
    return 5.0 - distance


@pytest.mark.parametrize('width', [0.05, 0.2])
def test_a_gap_is_as_wide_as_it_says_and_where_the_seed_says(go2, width):
    places = np.arange(0.7, 1.5, 0.005)
    begins = set()
    for seed in range(3):
        world = build_world(go2, f'gap:{width}', seed)
        heights = np.round([top(world, x) for x in places], 6)
        assert set(heights) == {0.0, -PIT}
        deep = places[heights < 0.0]
        assert len(deep) * 0.005 == pytest.approx(width, abs=0.006)
        begins.add(deep[0])
    assert len(begins) == 3
    assert abs(top(world, 6.0)) < 1e-9
