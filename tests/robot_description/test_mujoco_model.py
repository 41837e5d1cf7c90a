# SPDX-License-Identifier: Apache-2.0
import mujoco
import numpy as np
import pytest
from robot_description.errors import DescriptionError
from robot_description.expand import expand
from robot_description.mujoco_model import ROOT_JOINT
from robot_description.mujoco_model import to_mujoco
from robot_description.mujoco_visuals import COLLISION_GROUP
from robot_description.mujoco_visuals import VISUAL_GROUP
from robot_description.robots import description_path
from robot_description.urdf import parse_urdf

INERTIA = '<inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/>'
BOX = '<box size="1 1 1"/>'
SPHERE = '<sphere radius="0.1"/>'
CYLINDER = '<cylinder radius="0.1" length="1"/>'


def link(name, *shapes):
    collisions = ''.join(
        f'<collision><geometry>{shape}</geometry></collision>' for shape in shapes
    )
    inertial = f'<inertial><mass value="1"/>{INERTIA}</inertial>'
    return f'<link name="{name}">{inertial}{collisions}</link>'


@pytest.fixture(scope='module')
def urdf():
    return expand(description_path('mbot'))


@pytest.fixture(scope='module')
def spec(urdf):
    return to_mujoco(urdf, parse_urdf(urdf), visuals=True)


@pytest.fixture(scope='module')
def model(spec):
    return spec.compile()


def test_mbot_floats_and_has_four_wheels_and_two_motors(model):
    assert (model.nq, model.nv, model.nu) == (7 + 4, 6 + 4, 2)
    root = model.joint(ROOT_JOINT)
    assert root.type[0] == mujoco.mjtJoint.mjJNT_FREE
    assert model.body(model.jnt_bodyid[root.id]).name == 'base_footprint'


def test_no_mass_is_lost(model, urdf):
    assert model.body_mass.sum() == pytest.approx(parse_urdf(urdf).mass, abs=1e-9)


def test_the_wheels_spin_with_the_inertia_of_a_disc(model):
    model_data = mujoco.MjData(model)
    mujoco.mj_forward(model, model_data)
    for name in ('left_wheel_link', 'right_wheel_link'):
        body = model.body(name)
        R_world_inertia = model_data.ximat[body.id].reshape(3, 3)
        inertia = R_world_inertia @ np.diag(body.inertia) @ R_world_inertia.T
        assert inertia[1, 1] == pytest.approx(3.6e-4, rel=1e-9)


def test_motors_are_called_like_their_joints_and_stop_at_the_effort_limit(model):
    assert [model.actuator(i).name for i in range(2)] == ['left_wheel_joint', 'right_wheel_joint']
    np.testing.assert_array_equal(model.actuator_forcerange, [[-2.0, 2.0], [-2.0, 2.0]])
    assert model.actuator_forcelimited.all()


def test_what_is_drawn_does_not_collide_and_what_collides_is_not_drawn(model):
    collides = (model.geom_contype | model.geom_conaffinity) != 0
    np.testing.assert_array_equal(
        model.geom_group, np.where(collides, COLLISION_GROUP, VISUAL_GROUP)
    )
    assert collides.sum() == 5  # drum, two wheels, two casters
    assert (~collides).sum() == 10  # and a nose, two spokes, the lidar and the camera


def test_a_wheel_collides_as_an_ellipsoid_of_its_own_size(model):
    ellipsoids = model.geom_size[model.geom_type == mujoco.mjtGeom.mjGEOM_ELLIPSOID]
    np.testing.assert_allclose(ellipsoids, [[0.06, 0.06, 0.0125]] * 2)


def test_contacts_are_stiff_and_their_friction_is_the_robots_own(model):
    for name, friction, dimensions in (('left_wheel_link', 1.0, 3), ('front_caster_link', 0.0, 1)):
        body = model.body(name)
        geoms = range(body.geomadr[0], body.geomadr[0] + body.geomnum[0])
        (geom,) = (g for g in geoms if model.geom_group[g] == COLLISION_GROUP)
        assert model.geom_friction[geom, 0] == friction
        assert model.geom_condim[geom] == dimensions
        assert model.geom_priority[geom] == 1
        np.testing.assert_array_equal(model.geom_solref[geom], [0.004, 1.0])


def test_the_friction_of_a_link_that_is_welded_on_is_kept():
    text = (
        f'<robot name="r">{link("base", BOX)}'
        f'{link("skid", SPHERE)}'
        '<joint name="weld" type="fixed"><parent link="base"/><child link="skid"/></joint>'
        '<gazebo reference="skid"><mu1>0</mu1></gazebo></robot>'
    )
    model = to_mujoco(text, parse_urdf(text)).compile()
    sphere = model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE
    np.testing.assert_array_equal(model.geom_condim[sphere], [1])
    np.testing.assert_array_equal(model.geom_condim[~sphere], [3])
    assert model.body_mass.sum() == pytest.approx(2.0)


def test_a_cylinder_that_does_not_roll_stays_a_cylinder():
    text = (
        f'<robot name="r">{link("base")}{link("pole", CYLINDER)}'
        '<joint name="hinge" type="continuous"><parent link="base"/><child link="pole"/>'
        '<axis xyz="0 1 0"/></joint><gazebo reference="pole"><mu1>0.5</mu1></gazebo></robot>'
    )
    model = to_mujoco(text, parse_urdf(text)).compile()
    np.testing.assert_array_equal(model.geom_type, [mujoco.mjtGeom.mjGEOM_CYLINDER])
    assert model.geom_friction[0, 0] == 0.5


def test_a_joint_without_an_effort_limit_swings_freely():
    text = (
        f'<robot name="r">{link("base")}{link("arm")}'
        '<joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/></joint>'
        '</robot>'
    )
    assert to_mujoco(text, parse_urdf(text)).compile().nu == 0


def test_what_mujoco_cannot_read_is_one_line():
    text = f'<robot name="r">{link("base", BOX)}</robot>'
    robot = parse_urdf(text)
    with pytest.raises(DescriptionError, match='^MuJoCo: ') as caught:
        to_mujoco(text.replace('1 1 1', '1 1'), robot)
    assert '\n' not in str(caught.value)
