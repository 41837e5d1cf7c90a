# SPDX-License-Identifier: Apache-2.0
"""What descriptions leave out of driven wheels: motors, tyres, casters that slide."""

from dataclasses import replace

from cases import for_all
from descriptions import robot_named
import mujoco
import pytest
from robot_description.description import load_robot
from robot_description.morphology.equip_wheels import equip_drive, lowest_point
from robot_description.morphology.wheels import find_drive
from robot_description.mujoco.builder import compile_model, to_mujoco
from robot_description.urdf import parse_urdf
from wasd import Mbot
from wasd_core.robot_io import GRAVITY


def parsed(name):
    return parse_urdf(robot_named(name).urdf)


def equipped(robot):
    return equip_drive(robot, find_drive(robot))


@pytest.fixture
def bare():
    """Return mbot without limits on its joints and without friction."""
    robot = parsed('mbot')
    joints = {n: replace(j, effort=0.0, velocity=0.0) for n, j in robot.joints.items()}
    return replace(robot, joints=joints, friction={})


@pytest.mark.slow
def test_what_a_description_says_stays():
    for name in ('mbot', 'go2'):
        before, after = parsed(name), load_robot(name).robot
        assert after.friction == before.friction
        limits = [
            {n: (j.effort, j.velocity) for n, j in each.joints.items()} for each in (before, after)
        ]
        assert limits[0] == limits[1]


def test_wheels_without_limits_get_motors_that_can_make_them_slip(bare):
    left = equipped(bare).joints['left_wheel_joint']
    # Half the weight on a wheel of 6 cm slips at 1.8 kg g / 2 * 0.06 m, on friction 1.
    assert left.effort == pytest.approx(2.0 * 0.5 * 1.8 * GRAVITY * 0.06)
    assert left.velocity == pytest.approx(1.5 / 0.06)
    assert equipped(bare).joints['front_caster_joint'].effort == 0.0


def test_a_motor_that_no_file_describes_overcomes_what_its_joint_takes(bare):
    name, free = 'left_wheel_joint', equipped(bare).joints['left_wheel_joint']
    heavy = replace(bare.joints[name], friction=10.5, damping=21.8)
    joint = equipped(replace(bare, joints={**bare.joints, name: heavy})).joints[name]
    assert joint.velocity == free.velocity
    assert joint.effort == pytest.approx(free.effort + 10.5 + 21.8 * joint.velocity)


def test_tyres_hold_and_what_else_touches_the_floor_slides(bare):
    assert equipped(bare).friction == {
        'left_wheel_link': 1.0,
        'right_wheel_link': 1.0,
        'front_caster_link': 0.0,
        'back_caster_link': 0.0,
    }


@for_all('said', [{}, {'rim': 0.7}, {'hub': 0.6}, {'hub': 0.6, 'rim': 0.7}])
def test_a_tyre_that_is_welded_to_the_wheel_grips_as_the_wheel_does(said):
    tyre = (
        '<collision><origin rpy="1.5707963 0 0"/><geometry><cylinder radius="0.1" length="0.02"/>'
        '</geometry></collision>'
    )
    wheels = ''.join(
        f'<link name="hub{n}"/><joint name="axle{n}" type="continuous"><origin xyz="0 {y} 0"/>'
        f'<parent link="base"/><child link="hub{n}"/><axis xyz="0 1 0"/></joint>'
        f'<link name="rim{n}">{tyre}</link><joint name="weld{n}" type="fixed">'
        f'<parent link="hub{n}"/><child link="rim{n}"/></joint>'
        for n, y in (('1', 0.2), ('2', -0.2))
    )
    robot = parse_urdf(f'<robot name="cart"><link name="base"/>{wheels}</robot>')
    described = {f'{name}{n}': mu for name, mu in said.items() for n in '12'}
    after = equipped(replace(robot, friction=described))
    usual = next(iter(said.values()), 1.0)
    assert after.casters == frozenset()
    assert after.friction == {
        f'{name}{n}': said.get(name, usual) for name in ('hub', 'rim') for n in '12'
    }
    # What rolls is round and touches in one point; the rim would touch beside it.
    assert [len(after.links[name].collisions) for name in ('hub1', 'rim1')] == [1, 0]


ARM = ''.join(
    f'<link name="{name}"><inertial><mass value="0.1"/><inertia ixx="1e-4" ixy="0" ixz="0" '
    f'iyy="1e-4" iyz="0" izz="1e-4"/></inertial>{shape}</link>'
    f'<joint name="{name}" type="prismatic"><parent link="{parent}"/><child link="{name}"/>'
    '<limit lower="0" upper="1" effort="10" velocity="1"/></joint>'
    for name, parent, shape in (
        ('lift', 'mount', ''),
        ('arm', 'lift', ''),
        ('hand', 'arm', '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'),
    )
)


def test_an_arm_that_lies_in_a_wheel_with_its_joints_at_0_does_not_brake_it():
    urdf, bare = robot_named('mbot').urdf, parsed('mbot')
    x, y, z = bare.zero_poses['left_wheel_link'].position
    mount = (
        f'<link name="mount"/><joint name="mount" type="fixed"><parent link="{bare.root}"/>'
        f'<child link="mount"/><origin xyz="{x} {y} {z + 0.03}"/></joint>'
    )
    robot = parse_urdf(urdf.replace('</robot>', f'{mount}{ARM}</robot>'))
    for each, touching in ((robot, True), (equipped(robot), False)):
        model = compile_model(to_mujoco(each))
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        pairs = [{model.geom(geom).name for geom in pair} for pair in data.contact.geom.tolist()]
        assert ({'left_wheel_link/0', 'hand/0'} in pairs) is touching, pairs


@pytest.mark.slow
def test_a_robot_without_such_wheels_is_left_alone():
    robot = parsed('go2')
    assert equipped(robot) is robot
    assert find_drive(robot).wheels == ()


@for_all(
    ('shape', 'rpy', 'lowest'),
    [
        ('<sphere radius="0.1"/>', '0 0 0', 0.9),
        ('<box size="0.2 0.4 0.6"/>', '0 0 0', 0.7),
        ('<box size="0.2 0.4 0.6"/>', '1.5707963267948966 0 0', 0.8),
        ('<cylinder radius="0.1" length="0.6"/>', '0 0 0', 0.7),
        ('<cylinder radius="0.1" length="0.6"/>', '0 1.5707963267948966 0', 0.9),
    ],
)
def test_the_lowest_point_of_a_shape(shape, rpy, lowest):
    text = f'<origin xyz="0 0 1" rpy="{rpy}"/><geometry>{shape}</geometry>'
    for kind in ('collision', 'visual'):  # what is drawn, where nothing collides
        robot = parse_urdf(
            f'<robot name="r"><link name="base"><{kind}>{text}</{kind}></link></robot>'
        )
        assert lowest_point(robot) == pytest.approx(lowest)


@pytest.mark.slow
def test_a_robot_that_floats_on_a_world_is_let_go(tmp_path):
    """As some simulators want it written; it was held, and its wheels slid."""
    text = robot_named('mbot').urdf
    text = text[: text.rindex('</robot>')] + (
        '<link name="world"/><joint name="free" type="floating"><parent link="world"/>'
        f'<child link="{parsed("mbot").root}"/><origin xyz="0 0 1"/></joint></robot>'
    )
    (path := tmp_path / 'floating.urdf').write_text(text)
    assert not any(wheel.mounts for wheel in find_drive(parse_urdf(text)).wheels)
    robot = Mbot(description=path)
    robot.drive(0.3)
    robot.run(2.0)
    assert robot.truth.position[0] > 0.3
