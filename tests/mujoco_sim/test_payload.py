# SPDX-License-Identifier: Apache-2.0
"""A payload: as heavy as it says, where it says, of no other effect."""

import dataclasses
import math

from cases import for_all
from mujoco_sim.parameters import Payload, Untold
from mujoco_sim.robot_setup import usual_setup
from mujoco_sim.world import build_world
import numpy as np
import pytest
from robot_description.description import load_robot
from wasd_core.errors import UserError


@pytest.fixture(scope='module')
def go2():
    return load_robot('go2')


def base_of(description, payload):
    """Return mass [kg], centre [m] and moments about its frame [kg m^2] of a robot's base."""
    setup = dataclasses.replace(usual_setup(description), untold=Untold(payload=payload))
    world = build_world(description, setup=setup)
    model, root = world.model, world.root
    mass, centre = float(model.body_mass[root]), model.body_ipos[root].copy()
    return mass, centre, float(model.body_inertia[root].sum()), world


@pytest.mark.parametrize('place', [(0.0, 0.0, 0.0), (0.05, 0.1, 0.1)])
def test_the_base_is_as_much_heavier_and_its_centre_where_both_are_in_balance(go2, place):
    mass, centre, _, world = base_of(go2, None)
    loaded, moved, _, other = base_of(go2, Payload(8.0, place))
    assert loaded == pytest.approx(mass + 8.0)
    expected = (mass * centre + 8.0 * np.array(place)) / (mass + 8.0)
    np.testing.assert_allclose(moved, expected, atol=1e-9)
    assert other.joint_names == world.joint_names
    assert other.model.nbody == world.model.nbody


def test_off_the_centre_it_adds_to_the_moments_of_inertia_as_steiner_says(go2):
    mass, centre, inertia, _ = base_of(go2, None)
    _, _, at_centre, _ = base_of(go2, Payload(2.0, tuple(centre)))
    _, _, away, _ = base_of(go2, Payload(2.0, tuple(centre + (0.0, 0.0, 0.2))))
    assert at_centre > inertia
    # The sum of the three moments grows by twice the reduced mass times the distance squared.
    reduced = mass * 2.0 / (mass + 2.0)
    assert away - at_centre == pytest.approx(2.0 * reduced * 0.2**2, rel=1e-6)


def test_a_payload_touches_nothing(go2):
    _, _, _, world = base_of(go2, Payload(8.0, (0.0, 0.0, -0.3)))
    geom = world.model.geom('base/payload')
    assert geom.contype[0] == geom.conaffinity[0] == 0


def test_a_link_may_be_called_payload_and_lie_anywhere(tmp_path):
    link = '<link name="{}"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1"'
    link += ' iyz="0" izz="1"/></inertial><collision><geometry><sphere radius="0.1"/></geometry>'
    link += '</collision></link>'
    joint = '<joint name="j" type="{}"><parent link="base"/><child link="payload"/>'
    joint += '<axis xyz="0 0 1"/></joint>'
    for kind in ('fixed', 'continuous'):
        path = tmp_path / f'{kind}.urdf'
        parts = link.format('base'), link.format('payload'), joint.format(kind)
        path.write_text(f'<robot name="r">{"".join(parts)}</robot>')
        *_, world = base_of(load_robot(str(path)), Payload(8.0))
        assert float(world.model.body_mass.sum()) == pytest.approx(10.0)
        geoms = {world.model.geom(index).name for index in range(world.model.ngeom)}
        assert {'base/payload', 'payload/0'} <= geoms


@for_all(
    ('words', 'said'),
    [
        ({'friction': 0.0}, 'friction must be >= 0.01 and <= 2, got 0.0'),
        ({'friction': math.nan}, 'friction: got nan, wanted a finite number'),
        ({'randomise': 5.0}, 'randomise must be >= 0 and <= 1, got 5.0'),
        ({'imu_drift': -1.0}, 'imu_drift must be >= 0 and <= 100, got -1.0'),
        ({'payload': Payload(-1.0)}, r'payload: got \(-1.0, .*wanted a mass > 0'),
        ({'payload': Payload(1.0, (math.inf, 0.0, 0.0))}, 'payload: got '),
        ({'payload': Payload(8.0, (1000.0, 0.0, 0.0))}, 'kg, X, Y and Z within 1 m'),
    ],
)
def test_what_no_robot_or_floor_can_have_is_refused_wherever_it_comes_from(words, said):
    with pytest.raises(UserError, match=said):
        Untold(**words)


def test_a_payload_is_a_mass_and_where_it_is():
    assert Payload.parse('8') == Payload(8.0, (0.0, 0.0, 0.0))
    assert Payload.parse('.5@0.1,-.2,3e-2') == Payload(0.5, (0.1, -0.2, 0.03))


@for_all(
    'text', ['', '0', '-1', '101', 'heavy', 'inf', '8@', '8@1,2', '8@0,0,nan', '8@0,-1e3,0', '@']
)
def test_anything_else_is_no_payload(text):
    with pytest.raises(UserError, match='payload: got .*, wanted KG or KG@X,Y,Z'):
        Payload.parse(text)
