# SPDX-License-Identifier: Apache-2.0
"""What of a robot touches what follows from its tree and its gazebo tags."""

from cases import for_all
import mujoco
import numpy as np
import pytest
from robot_description.mujoco.builder import to_mujoco
from robot_description.urdf import parse_urdf
from wasd_core.errors import DescriptionError

INERTIAL = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
)
BALL = '<collision><geometry><sphere radius="1"/></geometry></collision>'


def link(name, inside=INERTIAL + BALL):
    return f'<link name="{name}">{inside}</link>'


def joint(parent, child, kind='continuous', inside=''):
    return (
        f'<joint name="{parent}_{child}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/>{inside}</joint>'
    )


def tag(reference, said):
    return f'<gazebo reference="{reference}">{said}</gazebo>'


def spec(*elements):
    text = f'<robot name="r">{"".join(elements)}</robot>'
    return to_mujoco(parse_urdf(text))


def touching(*elements):
    """Return the pairs of links that touch where all are in one place."""
    model = spec(*elements).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    names = [model.geom(i).name.partition('/')[0] for i in range(model.ngeom)]
    return {frozenset(names[geom] for geom in pair) for pair in data.contact.geom}


# base - a - b - c, and d on the base.
CHAIN = (
    *(link(name) for name in ('base', 'a', 'b', 'c', 'd')),
    *(joint(*ends) for ends in (('base', 'a'), ('a', 'b'), ('b', 'c'), ('base', 'd'))),
)


def pairs(*names):
    return {frozenset(pair.split()) for pair in names}


def test_links_three_joints_apart_touch():
    assert touching(*CHAIN) == pairs('base c', 'd a', 'd b', 'd c')


@for_all('said', ['<self_collide>0</self_collide>', '<selfCollide>false</selfCollide>'])
def test_a_link_that_may_not_touch_the_robot_does_not(said):
    assert touching(*CHAIN, tag('d', said)) == pairs('base c')


def test_a_link_that_may_touch_the_robot_does_as_without_a_word():
    said = '<self_collide>1</self_collide>'
    assert touching(*CHAIN, tag('d', said)) == touching(*CHAIN)


def test_what_is_welded_on_is_one_with_what_carries_it():
    # As in Unitree's clone: base carries trunk, trunk the legs; the feet are welded to the calves.
    elements = (
        link('base', ''), joint('base', 'trunk', 'fixed'), link('trunk'), link('hip'),
        link('thigh'), link('foot'), joint('trunk', 'hip'), joint('hip', 'thigh'),
        joint('thigh', 'foot', 'fixed'),
    )  # fmt: skip
    assert touching(*elements) == set()
    debug = (link('world', ''), joint('world', 'base', 'fixed'))
    assert touching(*debug, *elements) == set()


def test_unknown_words_of_gazebo_are_ignored():
    words = (
        '<gravity>true</gravity><kp value="1"/><sensor name="s" type="imu"><link>x</link></sensor>'
    )
    plugin = '<gazebo><plugin name="p" filename="p.so"><link>base</link></plugin></gazebo>'
    said = '<mu1>1</mu1><self_collide>0</self_collide>'
    nothing = tag('world', said) + tag('nobody', said)
    transmission = '<transmission name="t"><joint name="base_a"/></transmission>'
    assert touching(*CHAIN, tag('a', words), plugin, transmission, nothing) == touching(*CHAIN)


def test_a_hanging_robot_hangs_above_the_floor_and_a_standing_one_stands():
    below = '<origin xyz="0 0 -2"/>'
    leg = (link('world', ''), link('base'), link('leg'), joint('world', 'base', 'fixed'))
    hanging = spec(*leg, joint('base', 'leg', inside=below)).compile()
    data = mujoco.MjData(hanging)
    mujoco.mj_forward(hanging, data)
    assert data.body('leg').xpos[2] - 1.0 == pytest.approx(0.05)
    above = '<origin xyz="0 0 1"/>'
    arm = (link('world', ''), link('base'), joint('world', 'base', 'fixed', inside=above))
    standing = spec(*arm).compile()
    np.testing.assert_allclose(standing.body('base').pos, [0.0, 0.0, 1.0])


def test_a_joint_that_mimics_another_has_no_motor_and_follows():
    limit = '<limit effort="1" velocity="1" lower="-1" upper="1"/>'
    mimic = '<mimic joint="base_a" multiplier="2" offset="0.1"/>'
    model = spec(
        link('base', INERTIAL), link('a', INERTIAL), link('b', INERTIAL),
        joint('base', 'a', 'revolute', limit), joint('base', 'b', 'revolute', limit + mimic),
    ).compile()  # fmt: skip
    assert [model.actuator(i).name for i in range(model.nu)] == ['base_a']
    assert model.neq == 1
    np.testing.assert_allclose(model.eq_data[0, :2], [0.1, 2.0])


def test_a_prismatic_joint_slides_and_a_planar_one_slides_twice_and_turns():
    model = spec(
        link('base'), link('a'), link('b'), joint('base', 'a', 'prismatic'),
        joint('base', 'b', 'planar'),
    ).compile()  # fmt: skip
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    kinds = sorted(int(kind) for kind in (slide, slide, slide, hinge))
    assert sorted(model.jnt_type[1:].tolist()) == kinds


def test_a_joint_may_float_on_an_empty_root_only():
    model = spec(link('odom', ''), link('base'), joint('odom', 'base', 'floating')).compile()
    assert (model.nq, model.body_mass.sum()) == (7, 1.0)
    with pytest.raises(DescriptionError, match=r"'base_a' floats within the robot"):
        spec(link('base'), link('a'), joint('base', 'a', 'floating'))


def test_a_type_of_joint_that_is_none_is_said_with_those_that_are():
    with pytest.raises(DescriptionError, match=r"'base_a': type 'ball', wanted one of revolute"):
        spec(link('base'), link('a'), joint('base', 'a', 'ball'))


@pytest.mark.parametrize('axis', ['1 0 0', '0 0 1', '0 -1 0', '-1 0 0', '1 2 -2'])
def test_the_axis_of_a_planar_joint_is_the_normal_of_its_plane(axis):
    planar = joint('base', 'b', 'planar', f'<axis xyz="{axis}"/>')
    model = spec(link('base'), link('b'), planar).compile()
    normal = np.array([float(word) for word in axis.split()])
    first, second, turn = model.jnt_axis[1:]
    np.testing.assert_allclose(turn, normal / np.linalg.norm(normal), atol=1e-12)
    np.testing.assert_allclose(np.cross(first, second), turn, atol=1e-12)


def test_a_drum_that_hovers_over_the_floor_touches_it_at_no_heading():
    drum = '<collision><geometry><cylinder radius="0.2" length="0.16"/></geometry></collision>'
    hovering = spec(link('drum', INERTIAL + drum))
    hovering.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    model = hovering.compile()
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    data.qpos[2] = 0.11
    for yaw in rng.uniform(-np.pi, np.pi, 2000):
        # Upright but for the rounding of a simulation at rest.
        tilt = 3e-16 * rng.normal(size=2)
        data.qpos[3:] = np.cos(yaw / 2), *tilt, np.sin(yaw / 2)
        mujoco.mj_fwdPosition(model, data)
        assert not data.ncon
