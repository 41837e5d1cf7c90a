# SPDX-License-Identifier: Apache-2.0
import math

from cases import for_all
import numpy as np
import pytest
from robot_description.describe_command import main
from robot_description.robot import absurd_size, GREY
from robot_description.urdf import parse_urdf
from wasd_core.errors import DescriptionError
from wasd_core.rotations import axis_angle, IDENTITY, rpy_matrix

RNG = np.random.default_rng(1)
ANGLES = RNG.uniform(-math.pi, math.pi, size=(8, 3)).tolist()


def joint(parent, child, kind='fixed', inner=''):
    return (
        f'<joint name="{parent}_{child}" type="{kind}">'
        f'<parent link="{parent}"/><child link="{child}"/>{inner}</joint>'
    )


def robot(*links, rest=''):
    return f'<robot name="r">{"".join(f"<link name={name!r}/>" for name in links)}{rest}</robot>'


@for_all('rpy', ANGLES)
def test_rpy_turns_about_fixed_axes_x_first(rpy):
    x, y, z = np.eye(3)
    roll, pitch, yaw = rpy
    rotation = rpy_matrix(roll, pitch, yaw)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    # The three angles read back, as every text-book has them.
    assert math.atan2(rotation[2, 1], rotation[2, 2]) == pytest.approx(
        roll if abs(pitch) < math.pi / 2 else roll - math.copysign(math.pi, roll)
    )
    np.testing.assert_allclose(rpy_matrix(roll, 0, 0), axis_angle(x, roll), atol=1e-15)
    np.testing.assert_allclose(rpy_matrix(0, 0, yaw) @ x, [math.cos(yaw), math.sin(yaw), 0])


@for_all('angle', [-2.0, 0.0, 0.5, math.pi])
def test_a_turn_keeps_its_axis_and_adds_up(angle):
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    np.testing.assert_allclose(axis_angle(axis, angle) @ axis, axis, atol=1e-15)
    np.testing.assert_allclose(
        axis_angle(axis, angle) @ axis_angle(axis, 0.3), axis_angle(axis, angle + 0.3), atol=1e-14
    )


@for_all('name, kind', [('world', 'floating'), ('odom', 'planar'), ('base_footprint', 'floating')])
def test_an_empty_root_in_which_a_robot_moves_freely_is_no_part_of_it(name, kind):
    rest = joint(name, 'base', kind, '<origin xyz="1 2 3" rpy="0 0 3"/>') + joint('base', 'a')
    read = parse_urdf(robot(name, 'base', 'a', rest=rest))
    assert (read.root, list(read.joints), read.is_fixed) == ('base', ['base_a'], False)
    assert read.notes == (
        f"joint '{name}_base' lets the robot move freely in {name!r}: it floats",
    )


def test_frames_above_a_joint_on_which_a_robot_moves_freely_are_no_part_of_it():
    frames = joint('map', 'odom', 'fixed') + joint('odom', 'foot', 'planar')
    rest = joint('foot', 'base', 'fixed') + joint('base', 'a')
    read = parse_urdf(robot('map', 'odom', 'foot', 'base', 'a', rest=frames + rest))
    assert (read.root, list(read.joints)) == ('foot', ['foot_base', 'base_a'])
    assert list(read.links) == ['foot', 'base', 'a']
    moved = parse_urdf(
        robot(
            'map', 'odom', 'foot', 'base', 'a', rest=frames.replace('fixed', 'continuous') + rest
        )
    )
    assert (moved.root, len(moved.joints)) == ('map', 4)


@for_all(
    'inside, more',
    [
        ('<inertial><mass value="1"/></inertial>', ''),
        ('<visual><geometry><sphere radius="1"/></geometry></visual>', ''),
        ('', joint('odom', 'b')),
    ],
)
def test_a_root_with_a_body_or_two_joints_is_a_part_of_the_robot(inside, more):
    text = robot('base', 'b', rest=joint('odom', 'base', 'planar') + (more or joint('base', 'b')))
    read = parse_urdf(text.replace('<link', f'<link name="odom">{inside}</link><link', 1))
    assert (read.root, len(read.joints), read.notes) == ('odom', 2, ())


def test_a_link_is_where_the_joints_above_put_it():
    text = robot(
        'a', 'b', 'c',
        rest=joint('a', 'b', inner='<origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/>')
        + joint('b', 'c', inner='<origin xyz="0 2 0"/>'),
    )  # fmt: skip
    pose = parse_urdf(text).zero_poses['c']
    np.testing.assert_allclose(pose.position, [-1.0, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(pose.rotation @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)


def test_a_turning_joint_turns_and_a_sliding_joint_slides():
    text = robot(
        'a', 'b', 'c',
        rest=joint('a', 'b', 'revolute', '<axis xyz="0 0 2"/>')
        + joint('b', 'c', 'prismatic', '<axis xyz="0 3 4"/>'),
    )  # fmt: skip
    joints = parse_urdf(text).joints
    turned = joints['a_b'].transform(math.pi / 2)
    np.testing.assert_allclose(turned.rotation @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(joints['b_c'].transform(5.0).position, [0.0, 3.0, 4.0])


def test_composing_with_nothing_changes_nothing():
    pose = parse_urdf(
        robot('a', 'b', rest=joint('a', 'b', inner='<origin xyz="1 2 3" rpy=".1 .2 .3"/>'))
    ).zero_poses['b']
    for composed in (pose @ IDENTITY, IDENTITY @ pose):
        np.testing.assert_array_equal(composed.position, pose.position)
        np.testing.assert_array_equal(composed.rotation, pose.rotation)


def test_what_a_joint_leaves_out_has_urdfs_default():
    found = parse_urdf(robot('a', 'b', rest=joint('a', 'b', 'continuous'))).joints['a_b']
    assert (found.effort, found.velocity) == (0.0, 0.0)
    np.testing.assert_array_equal(found.axis, [1.0, 0.0, 0.0])
    np.testing.assert_array_equal(found.pose.rotation, np.eye(3))


def test_every_collision_shape_is_kept_in_order():
    text = (
        '<robot name="r"><link name="a">'
        '<collision><geometry><mesh filename="a.stl"/></geometry></collision>'
        '<collision><geometry><cylinder radius="1" length="2"/></geometry></collision>'
        '<collision><geometry><box size="1 2 3"/></geometry></collision>'
        '<collision><geometry><sphere radius="4"/></geometry></collision>'
        '</link></robot>'
    )
    shapes = [(shape.kind, shape.size) for shape in parse_urdf(text).links['a'].collisions]
    assert shapes == [
        ('mesh', ()),
        ('cylinder', (1.0, 2.0)),
        ('box', (1.0, 2.0, 3.0)),
        ('sphere', (4.0,)),
    ]


@for_all(
    ('text', 'message'),
    [
        ('<robot', 'not well-formed XML'),
        ('<robot name="r"><mbot_base/></robot>', 'no links .*missing "xacro:"'),
        (robot('a', rest=joint('a', 'b')), "joint 'a_b' names link 'b', not defined"),
        (robot('a', 'b', 'c', rest=joint('a', 'b')), 'one root, found 2: a, c'),
        (robot('a', 'b', rest=joint('a', 'b') + joint('b', 'a')), 'one root, found 0'),
        (robot(*'abcdefghi'), 'one root, found 9: a, b, c, d, e, f, g, h, ...'),
        (
            robot('a', 'b', 'c', rest=joint('b', 'c') + joint('c', 'b')),
            'joints run in a circle through b, c',
        ),
        (
            robot('a', 'b', 'c', rest=joint('a', 'c') + joint('b', 'c')),
            "link 'c' is the child of two joints",
        ),
        (robot('a', 'a'), "link 'a' is defined twice"),
        ('<robot><link/></robot>', 'a link has no name'),
        (robot('a', 'b', rest=2 * joint('a', 'b')), "joint 'a_b' is defined twice"),
        (
            robot('a', 'b', rest=joint('a', 'b', inner='<origin xyz="0 0"/>')),
            "joint 'a_b': xyz needs 3 numbers, got '0 0'",
        ),
        (
            robot('a', 'b', rest=joint('a', 'b', inner='<origin rpy="0 0 x"/>')),
            "joint 'a_b': rpy needs 3 numbers, got '0 0 x'",
        ),
        (
            robot('a', 'b', rest=joint('a', 'b', 'revolute', inner='<axis xyz="0 0 0"/>')),
            "joint 'a_b': its axis is zero",
        ),
        (
            robot('a', 'b', rest=joint('a', 'b', inner='<limit effort="nan"/>')),
            "joint 'a_b': effort needs a number, got 'nan'",
        ),
        (
            '<robot><link name="a"><inertial><mass value="1kg"/></inertial></link></robot>',
            "link 'a': value needs a number, got '1kg'",
        ),
        (
            '<robot><link name="a"><collision><geometry><sphere/></geometry></collision>'
            '</link></robot>',
            "link 'a': sphere needs a number, got ''",
        ),
        (
            '<robot><link name="a"><inertial><origin xyz="0"/></inertial></link></robot>',
            "link 'a': inertial: xyz needs 3 numbers, got '0'",
        ),
    ],
)  # fmt: skip
def test_a_broken_description_is_one_line_that_says_where(text, message):
    with pytest.raises(DescriptionError, match=message) as caught:
        parse_urdf(text)
    assert '\n' not in str(caught.value)


def test_a_fixed_joint_needs_no_axis():
    # Exporters write a zero one, as in Unitree's own Go2.
    text = robot('a', 'b', rest=joint('a', 'b', inner='<axis xyz="0 0 0"/>'))
    assert parse_urdf(text).joints['a_b'].kind == 'fixed'


@for_all('length', ['1e-200', '1e200', '5e-324'])
def test_an_axis_of_any_length_is_a_direction(length):
    text = robot('a', 'b', rest=joint('a', 'b', 'revolute', f'<axis xyz="0 -{length} 0"/>'))
    assert parse_urdf(text).joints['a_b'].axis.tolist() == [0.0, -1.0, 0.0]


@for_all('loss', ['damping', 'friction'])
def test_a_damping_or_friction_that_would_drive_the_joint_is_refused(loss):
    text = robot('a', 'b', rest=joint('a', 'b', inner=f'<dynamics {loss}="-3"/>'))
    with pytest.raises(DescriptionError, match=f"'a_b': {loss} needs a number from 0 up, got -3"):
        parse_urdf(text)


def test_a_robot_knows_what_a_simulator_needs():
    text = (
        '<robot name="r"><material name="leaf"><color rgba="0 1 0 1"/></material>'
        '<link name="a"><inertial><origin xyz="1 2 3" rpy="0.1 0.2 0.3"/><mass value="1"/>'
        '</inertial></link>'
        '<link name="b">'
        '<collision><geometry><sphere radius="1"/></geometry></collision>'
        '<visual><geometry><sphere radius="2"/></geometry><material name="leaf"/></visual>'
        '<collision><geometry><sphere radius="3"/></geometry></collision>'
        '<visual><geometry><sphere radius="4"/></geometry></visual></link>'
        '<joint name="j" type="revolute"><parent link="a"/><child link="b"/>'
        '<dynamics damping="0.5" friction="0.25"/>'
        '<mimic joint="k" multiplier="-2" offset="0.1"/></joint><link name="c"/>'
        '<joint name="k" type="revolute"><parent link="a"/><child link="c"/></joint></robot>'
    )
    robot = parse_urdf(text)
    inertial = robot.links['a'].inertial
    assert inertial.position.tolist() == [1.0, 2.0, 3.0]
    assert inertial.rpy == (0.1, 0.2, 0.3)
    np.testing.assert_allclose(inertial.rotation, rpy_matrix(0.1, 0.2, 0.3))
    link = robot.links['b']
    assert [shape.size for shape in link.shapes] == [(1.0,), (2.0,), (3.0,), (4.0,)]
    assert [shape.size for shape in link.collisions] == [(1.0,), (3.0,)]
    assert [shape.rgba for shape in link.visuals] == [(0.0, 1.0, 0.0, 1.0), GREY]
    joint = robot.joints['j']
    assert (joint.damping, joint.friction) == (0.5, 0.25)
    assert (joint.mimics, joint.multiplier, joint.offset) == ('k', -2.0, 0.1)


def test_a_multiplier_that_is_no_number_is_refused_with_its_joint():
    text = (
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="revolute">'
        '<parent link="a"/><child link="b"/><mimic joint="j" multiplier="two"/></joint></robot>'
    )
    with pytest.raises(DescriptionError, match="joint 'j': multiplier needs a number, got 'two'"):
        parse_urdf(text)


def chain(*mimics):
    """Return a chain of joints j0, j1, ..., each of which mimics another, or none."""
    joints = (
        f'<joint name="j{i}" type="continuous"><parent link="l{i}"/><child link="l{i + 1}"/>'
        + f'<mimic joint="{other}"/></joint>'
        for i, other in enumerate(mimics)
    )
    links = (f'<link name="l{i}"/>' for i in range(len(mimics) + 1))
    return f'<robot name="r">{"".join(links)}{"".join(joints)}</robot>'


@for_all(
    ('mimics', 'words'),
    [
        (['j0'], 'circle: j0 -> j0'),
        (['j1', 'j2', 'j1'], 'circle: j1 -> j2 -> j1'),
        (['arm_elbow', '', ''], "joint 'j0' mimics joint 'arm_elbow', which is not there"),
    ],
)
def test_a_mimic_of_nothing_or_in_a_circle_is_refused(mimics, words):
    with pytest.raises(DescriptionError, match=words):
        parse_urdf(chain(*mimics))


def test_a_joint_may_mimic_one_that_mimics():
    assert parse_urdf(chain('j1', 'j2', '')).joints['j0'].mimics == 'j1'


def test_a_chain_that_no_simulator_takes_is_refused():
    assert len(parse_urdf(chain(*[''] * 399)).links) == 400
    with pytest.raises(DescriptionError, match='401 links hang on each other in a chain'):
        parse_urdf(chain(*[''] * 400))


@pytest.mark.slow
def test_the_longest_chain_is_shown(tmp_path, capsys):
    path = tmp_path / 'r.urdf'
    path.write_text(chain(*[''] * 399))
    assert main(['info', str(path)]) == 0
    assert 'j398' in capsys.readouterr().out


@for_all('text', ['low', 'nan', '-1', 'inf'])
def test_a_friction_that_is_no_number_is_noted_and_has_no_effect(text):
    parsed = parse_urdf(robot('a', rest=f'<gazebo reference="a"><mu1>{text}</mu1></gazebo>'))
    assert parsed.friction == {}
    assert parsed.notes == (f"mu1 of 'a' is no number, and has no effect: {text!r}",)


def test_axes_that_are_left_out_are_x_and_noted():
    joints = ''.join(
        f'<joint name="{kind}" type="{kind}"><parent link="a"/><child link="{kind[0]}1"/>{axis}'
        f'</joint><link name="{kind[0]}1"/>'
        for kind, axis in (('continuous', ''), ('revolute', '<axis/>'), ('fixed', ''))
    )
    parsed = parse_urdf(robot('a', rest=joints))
    assert parsed.joints['continuous'].axis.tolist() == [1.0, 0.0, 0.0]
    assert parsed.notes == (
        'joints without an axis turn about x, as URDF has it: continuous, revolute',
    )


def test_limits_that_are_exchanged_are_swapped_and_noted():
    joint = (
        '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
        '<limit lower="0.6" upper="-0.5" effort="1" velocity="1"/></joint><link name="b"/>'
    )
    parsed = parse_urdf(robot('a', rest=joint))
    assert (parsed.joints['j'].lower, parsed.joints['j'].upper) == (-0.5, 0.6)
    assert parsed.notes == ("joint 'j': lower and upper are exchanged (0.6, -0.5): swapped",)


@for_all(
    ('edge', 'line'),
    [
        (1e-4, 'the robot reaches 0.000173 m from its root: check units, URDF has metres'),
        (0.5, ''),
        (500.0, 'the robot reaches 866 m from its root: check units, URDF has metres'),
    ],
)
def test_a_size_that_no_robot_has_is_said(edge: float, line: str) -> None:
    box = f'<collision><geometry><box size="{edge} {edge} {edge}"/></geometry></collision>'
    parsed = parse_urdf(f'<robot name="r"><link name="a">{box}</link></robot>')
    assert absurd_size(parsed) == ((line,) if line else ())
