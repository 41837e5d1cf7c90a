# SPDX-License-Identifier: Apache-2.0
from cases import for_all
from descriptions import robot_named
import mujoco
import numpy as np
import pytest
from robot_description.mujoco.builder import compile_model, to_mujoco
from robot_description.mujoco.geoms import COLLISION_GROUP, VISUAL_GROUP
from robot_description.urdf import parse_urdf
from wasd_core.errors import DescriptionError
from wasd_core.robot_io import TIME_STEP

INERTIA = '<inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/>'
BOX = '<box size="1 1 1"/>'
SPHERE = '<sphere radius="0.1"/>'
CYLINDER = '<cylinder radius="0.1" length="1"/>'


BALL = '<sphere radius="0.1"/>'


def link(name, *shapes):
    collisions = ''.join(
        f'<collision><geometry>{shape}</geometry></collision>' for shape in shapes
    )
    inertial = f'<inertial><mass value="1"/>{INERTIA}</inertial>'
    return f'<link name="{name}">{inertial}{collisions}</link>'


@pytest.fixture(scope='module')
def urdf():
    return robot_named('mbot').urdf


@pytest.fixture(scope='module')
def spec(urdf):
    return to_mujoco(parse_urdf(urdf), visuals=True)


@pytest.fixture(scope='module')
def model(spec):
    return spec.compile()


def test_mbot_floats_and_has_four_wheels_and_two_motors(model):
    assert (model.nq, model.nv, model.nu) == (7 + 4, 6 + 4, 2)
    root = model.joint('root')
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
    model = to_mujoco(parse_urdf(text)).compile()
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
    model = to_mujoco(parse_urdf(text)).compile()
    np.testing.assert_array_equal(model.geom_type, [mujoco.mjtGeom.mjGEOM_CYLINDER])
    assert model.geom_friction[0, 0] == 0.5


def test_a_joint_without_an_effort_limit_swings_freely():
    text = (
        f'<robot name="r">{link("base")}{link("arm")}'
        '<joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/></joint>'
        '</robot>'
    )
    assert to_mujoco(parse_urdf(text)).compile().nu == 0


@for_all(
    ('shape', 'size'),
    [
        ('<sphere radius="0"/>', 'a sphere of 0 m'),
        ('<cylinder radius="-0.05" length="0.02"/>', 'a cylinder of -0.05 x 0.02 m'),
        ('<box size="1 0 1"/>', 'a box of 1 x 0 x 1 m'),
    ],
)
def test_a_shape_without_a_size_is_refused_by_its_link(shape, size):
    with pytest.raises(DescriptionError) as caught:
        to_mujoco(parse_urdf(f'<robot name="r">{link("base", shape)}</robot>'))
    assert str(caught.value) == f"link 'base' has {size}: wanted numbers above zero"


def test_a_negative_mass_is_quoted_as_it_is_written_whatever_hangs_on_the_link():
    text = (
        '<robot name="r"><link name="base"><inertial><mass value="-2"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        f'{link("arm")}'
        '<joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/></joint>'
        '</robot>'
    )
    with pytest.raises(DescriptionError, match="^link 'base' has a mass of -2 kg: weigh it$"):
        to_mujoco(parse_urdf(text))


def test_what_mujoco_cannot_compile_is_one_line():
    spec = to_mujoco(parse_urdf(f'<robot name="r">{link("base", BALL)}</robot>'))
    spec.geoms[0].size = [0.0, 0.0, 0.0]
    with pytest.raises(
        DescriptionError, match='^MuJoCo: Error: size 0 must be positive'
    ) as caught:
        compile_model(spec)
    assert '\n' not in str(caught.value)


def robot_of_two(arm, joint):
    return parse_urdf(
        f'<robot name="r">{link("base")}{link(arm)}<joint name="{joint}" type="continuous">'
        f'<parent link="base"/><child link="{arm}"/></joint></robot>'
    )


def test_a_link_name_that_mujoco_has_taken_is_refused_in_one_line():
    with pytest.raises(DescriptionError, match=r"^MuJoCo: Error: repeated name 'world'"):
        to_mujoco(robot_of_two('world', 'hinge'))


def test_a_joint_may_have_the_name_we_usually_give_the_free_one():
    model = to_mujoco(robot_of_two('arm', 'root')).compile()
    assert model.joint('root').type == mujoco.mjtJoint.mjJNT_HINGE
    assert model.njnt == 2


def hinge(kind='revolute', inside=''):
    """Return a robot of two links, `base` and `arm`, and what its joint `hinge` became."""
    text = (
        f'<robot name="r">{link("base")}{link("arm")}<joint name="hinge" type="{kind}">'
        f'<parent link="base"/><child link="arm"/>{inside}</joint></robot>'
    )
    model = to_mujoco(parse_urdf(text)).compile()
    return model, model.joint('hinge')


def test_a_joint_keeps_its_axis_range_damping_and_friction():
    model, joint = hinge(
        inside='<axis xyz="0 3 4"/><limit lower="-1.5" upper="0.5" effort="7" velocity="1"/>'
        '<dynamics damping="0.25" friction="0.125"/>'
    )
    np.testing.assert_allclose(joint.axis, [0.0, 0.6, 0.8])
    np.testing.assert_array_equal(joint.range, [-1.5, 0.5])  # radians, as in the file
    assert joint.limited[0]
    assert (joint.damping[0], joint.frictionloss[0]) == (0.25, 0.125)
    np.testing.assert_array_equal(model.jnt_actfrcrange[joint.id], [-7.0, 7.0])


@for_all(
    ('kind', 'limit'),
    [
        ('continuous', '<limit lower="-1" upper="1"/>'),
        ('revolute', '<limit lower="0" upper="0"/>'),
        ('revolute', ''),
    ],
)
def test_a_joint_without_limits_has_none(kind, limit):
    assert not hinge(kind, limit)[1].limited[0]


def test_limits_that_are_equal_lock_a_joint():
    model, joint = hinge(inside='<axis xyz="0 1 0"/><limit lower="0.5" upper="0.5" effort="1"/>')
    data = mujoco.MjData(model)
    data.qpos[joint.qposadr] = 0.5
    data.qfrc_applied[joint.dofadr] = 1.0
    mujoco.mj_step(model, data, 300)
    assert data.qpos[joint.qposadr] == pytest.approx(0.5, abs=2e-3)


def test_exchanged_limits_are_swapped():
    text = '<limit lower="1" upper="-2"/>'
    np.testing.assert_array_equal(hinge(inside=text)[1].range, [-2.0, 1.0])


def test_one_limit_alone_is_from_or_to_zero():
    # URDF's default of the other is 0; MuJoCo's own reader drops both.
    np.testing.assert_array_equal(hinge(inside='<limit upper="1"/>')[1].range, [0.0, 1.0])


def test_a_link_is_turned_as_its_origin_says_and_so_is_its_inertia():
    inertia = '<inertia ixx="3e-3" ixy="1e-4" ixz="2e-4" iyy="4e-3" iyz="3e-4" izz="5e-3"/>'
    origin = '<origin xyz="0.1 0.2 0.3" rpy="0.4 -0.5 0.6"/>'
    text = (
        f'<robot name="r">{link("base")}'
        f'<link name="arm"><inertial>{origin}<mass value="2"/>{inertia}</inertial></link>'
        f'<joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/>{origin}'
        '</joint></robot>'
    )
    robot = parse_urdf(text)
    model = to_mujoco(robot).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    arm, turn = model.body('arm').id, robot.joints['hinge'].pose.rotation
    np.testing.assert_allclose(data.xmat[arm].reshape(3, 3), turn, atol=1e-12)
    frame, inertial = data.ximat[arm].reshape(3, 3), robot.links['arm'].inertial
    expected = turn @ inertial.rotation @ robot.links['arm'].inertia @ (turn @ inertial.rotation).T
    np.testing.assert_allclose(
        frame @ np.diag(model.body_inertia[arm]) @ frame.T, expected, atol=1e-12
    )
    np.testing.assert_allclose(
        data.xipos[arm], robot.joints['hinge'].pose.position + turn @ inertial.position
    )


def test_geoms_are_in_the_order_of_the_file_and_collide_in_the_colour_drawn_before_them():
    def shape(use, size, inside=''):
        return f'<{use}><geometry><sphere radius="{size}"/></geometry>{inside}</{use}>'

    red = '<material name="red"><color rgba="1 0 0 1"/></material>'
    inside = shape('collision', 1) + shape('visual', 2, red) + shape('collision', 3)
    robot = parse_urdf(f'<robot name="r"><link name="a">{link("a")[15:-7]}{inside}</link></robot>')
    drawn, plain = (to_mujoco(robot, visuals=visuals).compile() for visuals in (True, False))
    assert drawn.geom_size[:, 0].tolist() == [1.0, 2.0, 3.0]
    assert [drawn.geom(i).name for i in range(3)] == ['a/0', '', 'a/1']
    np.testing.assert_array_equal(drawn.geom_rgba[1:], [[1.0, 0.0, 0.0, 1.0]] * 2)
    assert drawn.geom_rgba[0].tolist() == [0.5, 0.5, 0.5, 1.0]
    assert plain.geom_size[:, 0].tolist() == [1.0, 3.0]


def test_a_robot_hangs_as_high_however_much_of_it_is_drawn():
    mesh = '<visual><geometry><mesh filename="nowhere.stl"/></geometry></visual>'
    robot = parse_urdf(
        f'<robot name="r"><link name="world"/>{link("base", SPHERE).replace("</link>", mesh)}'
        '</link><joint name="j" type="fixed"><parent link="world"/><child link="base"/></joint>'
        '</robot>'
    )
    heights = [
        to_mujoco(robot, visuals=visuals).compile().body('base').pos[2]
        for visuals in (False, True)
    ]
    assert heights == [pytest.approx(0.15), pytest.approx(0.15)]


def test_a_link_whose_drawn_mesh_is_missing_still_needs_the_one_it_collides_with():
    meshes = ''.join(
        f'<{use}><geometry><mesh filename="{use}.stl"/></geometry></{use}>'
        for use in ('visual', 'collision')
    )
    box = f'<collision><geometry>{BOX}</geometry></collision>'
    text = f'<robot name="r">{link("a").replace("</link>", box + meshes)}</link></robot>'
    with pytest.raises(
        DescriptionError, match="'a' collides with what is not: mesh collision.stl"
    ):
        to_mujoco(parse_urdf(text), visuals=True)


def test_dry_friction_holds_a_light_wheel_against_half_of_it():
    text = (
        f'<robot name="r"><link name="world"/>{link("wheel").replace("1e-3", "5e-5")}'
        '<joint name="axle" type="continuous"><parent link="world"/><child link="wheel"/>'
        '<axis xyz="0 0 1"/><dynamics friction="10"/><limit effort="20" velocity="1"/></joint>'
        '</robot>'
    )
    spec = to_mujoco(parse_urdf(text))
    spec.option.timestep = TIME_STEP
    model = compile_model(spec)
    data = mujoco.MjData(model)
    data.ctrl[0] = 5.0
    mujoco.mj_step(model, data, nstep=100)
    assert abs(data.qpos[0]) < 2e-3
    data.ctrl[0] = 11.0
    mujoco.mj_step(model, data, nstep=100)
    assert data.qvel[0] == pytest.approx((11.0 - 10.0) / 5e-5 * 0.1, rel=0.02)
