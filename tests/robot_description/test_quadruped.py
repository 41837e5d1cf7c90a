# SPDX-License-Identifier: Apache-2.0
"""A quadruped is known by its tree and geometry; what is none is refused with what was found."""

from collections.abc import Callable
import math
from pathlib import Path
import re
import xml.etree.ElementTree as ElementTree

from cases import for_all
import numpy as np
import pytest
from robot_description.description import parse_description
from robot_description.morphology.quadruped import (
    equip_legs,
    find_imu,
    find_quadruped,
    imu_position,
    NotAQuadruped,
    Quadruped,
    scale_of,
)
from robot_description.packages import description_path
from robot_description.urdf import parse_urdf
from robot_description.xacro.session import expand_document

HIPS = {'FL': (0.2, 0.05), 'FR': (0.2, -0.05), 'RL': (-0.2, 0.05), 'RR': (-0.2, -0.05)}


def joint(name: str, parent: str, child: str, place: str, axis: str, **more: str) -> str:
    """Return a joint of URDF with limits, or what `more` says instead."""
    kind = more.get('kind', 'revolute')
    limit = more.get('limit', 'lower="-2" upper="2"')
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{place}" rpy="{more.get("rpy", "0 0 0")}"/><axis xyz="{axis}"/>'
        f'<limit effort="20" velocity="20" {limit}/></joint><link name="{child}">'
        f'<inertial><mass value="0.5"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" '
        f'ixz="0" iyz="0"/></inertial>{more.get("shape", "")}</link>'
    )


def sphere(place: str, radius: float = 0.02) -> str:
    """Return a ball to collide with."""
    return (
        f'<collision><origin xyz="{place}"/><geometry><sphere radius="{radius}"/></geometry>'
        '</collision>'
    )


def leg(name: str, x: float, y: float, **more: str) -> str:
    """Return a leg whose foot is a ball on its lower link."""
    side = math.copysign(0.08, y)
    calf = more.get('calf', 'lower="-2.5" upper="-0.5"')
    return (
        joint(f'{name}_a', 'body', f'{name}_1', f'{x} {y} 0', more.get('roll', '1 0 0'))
        + joint(f'{name}_b', f'{name}_1', f'{name}_2', f'0 {side} 0', '0 1 0')
        + joint(
            f'{name}_c', f'{name}_2', f'{name}_3', '0 0 -0.2', '0 1 0', limit=calf,
            shape=more.get('shape', sphere('0 0 -0.25')),
        )
    )  # fmt: skip


def dog(legs: str = '', extra: str = '', **more: str) -> str:
    """Return a robot with a body and four legs, or those given."""
    legs = legs or ''.join(leg(name, *place, **more) for name, place in HIPS.items())
    body = '<link name="body"><inertial><mass value="8"/></inertial></link>'
    return f'<robot name="dog">{body}{legs}{extra}</robot>'


def found(text: str) -> Quadruped:
    """Return the quadruped in a URDF."""
    return find_quadruped(parse_urdf(text))


@pytest.mark.slow
def test_the_go2_is_found_as_its_makers_name_it() -> None:
    go2 = found(expand_document(description_path('go2')).urdf)
    names = [f'{leg}_{part}_joint' for leg in HIPS for part in ('hip', 'thigh', 'calf')]
    assert list(go2.joint_names) == names
    assert go2.feet == ('FL_foot', 'FR_foot', 'RL_foot', 'RR_foot')
    assert [(leg.thigh, leg.calf, leg.bend) for leg in go2.legs] == [(0.213, 0.213, 1.0)] * 4
    np.testing.assert_array_equal(go2.sign, 1.0)
    np.testing.assert_array_equal(go2.zero, 0.0)


def test_legs_are_ordered_by_where_they_are() -> None:
    shuffled = ''.join(
        leg(f'limb{i}', *HIPS[name]) for i, name in enumerate(('RR', 'FL', 'RL', 'FR'))
    )
    assert found(dog(shuffled)).feet == ('limb1_3', 'limb3_3', 'limb2_3', 'limb0_3')


def test_a_ball_on_the_lower_leg_is_the_foot() -> None:
    front = found(dog()).legs[0]
    assert (front.thigh, front.calf, front.foot_radius) == pytest.approx((0.2, 0.25, 0.02))
    assert front.offset == pytest.approx(0.08)
    np.testing.assert_allclose(front.hip, (0.2, 0.05, 0.0))


@for_all(
    ('shape', 'length', 'radius'),
    [
        (sphere('0 0 -0.02', 0.03) + sphere('0 0 -0.25'), 0.25, 0.02),  # a knee guard is no foot
        (sphere('0.06 0 -0.25'), math.hypot(0.06, 0.25), 0.02),
        ('<collision><origin xyz="0 0 -0.12"/><geometry><cylinder radius="0.015" length="0.24"/>'
         '</geometry></collision>', 0.225, 0.015),
        ('<collision><origin xyz="0 0 -0.12" rpy="0 1.5707963267948966 0"/><geometry>'
         '<box size="0.24 0.02 0.03"/></geometry></collision>', 0.225, 0.015),
    ],
)  # fmt: skip
def test_the_foot_is_the_far_end_of_the_leg(shape: str, length: float, radius: float) -> None:
    front = found(dog(shape=shape)).legs[0]
    assert (front.calf, front.foot_radius) == pytest.approx((length, radius), abs=1e-9)


def test_a_foot_link_with_a_mesh_counts_by_its_name() -> None:
    feet = ''.join(
        joint(f'{name}_d', f'{name}_3', f'{name}_toe', '0 0 -0.3', '1 0 0', kind='fixed')
        for name in HIPS
    )
    front = found(dog(shape='', extra=feet)).legs[0]
    assert (front.foot, front.calf) == ('FL_toe', pytest.approx(0.3))
    assert 0.01 < front.foot_radius < 0.05


@for_all(('limit', 'bend'), [('lower="0.5" upper="2.5"', -1.0), ('', 1.0)])
def test_the_knee_bends_to_where_it_may(limit: str, bend: float) -> None:
    assert [leg.bend for leg in found(dog(calf=limit)).legs] == [bend] * 4


def test_turned_axes_and_frames_give_the_same_leg_angles() -> None:
    """HyQ's way: every axis is z of a turned frame, the hip's points backward."""
    half = math.pi / 2
    legs = ''
    for name, (x, y) in HIPS.items():
        legs += joint(
            f'{name}_a', 'body', f'{name}_1', f'{x} {y} 0', '0 0 1', rpy=f'0 {-half} 0',
            limit='lower="-0.5" upper="1"',
        )  # fmt: skip
        legs += joint(
            f'{name}_b', f'{name}_1', f'{name}_2', '-0.06 0 0', '0 0 1', rpy=f'{-half} 0 {math.pi}'
        )
        legs += joint(f'{name}_c', f'{name}_2', f'{name}_3', '0.2 0 0', '0 0 1',
                      limit='lower="-2" upper="-1"', shape=sphere('0.25 0 0'))  # fmt: skip
    front = found(dog(legs)).legs[0]
    assert (front.drop, front.thigh, front.calf) == pytest.approx((0.06, 0.2, 0.25))
    assert front.offset == pytest.approx(0.0, abs=1e-9)
    assert front.sign[0] == -1.0
    np.testing.assert_allclose(front.zero, 0.0, atol=1e-9)
    np.testing.assert_allclose((front.lower[0], front.upper[0]), (-1.0, 0.5))


def test_a_range_of_many_turns_is_not_wound_up() -> None:
    """Unitree's B2 has a thigh from -94 rad, a slip of the pen."""
    front = found(dog(calf='lower="-94" upper="-0.4"')).legs[0]
    assert front.zero[2] == 0.0


CAPSULE = '<capsule radius="0.015" length="0.21"/>'


@for_all(
    ('shape', 'down', 'radius'),
    [
        (CAPSULE, 0.225, 0.015),
        # A sole and a roller across the leg.
        ('<box size="0.1 0.05 0.02"/>', 0.12, 0.01),
        ('<cylinder radius="0.03" length="0.02"/>', 0.12, 0.01),
    ],
)
def test_the_lowest_point_of_a_foot_is_that_of_its_shape(
    shape: str, down: float, radius: float
) -> None:
    text = f'<collision><origin xyz="0 0 -0.12"/><geometry>{shape}</geometry></collision>'
    front = found(dog(shape=text)).legs[0]
    assert (front.calf, front.foot_radius) == pytest.approx((down, radius), abs=1e-9)


@for_all('named', [False, True])
def test_the_lowest_point_of_a_mesh_is_the_foot(tmp_path: Path, named: bool) -> None:
    """A shin that ends in a ball: its lowest point, and the ball's radius, within a millimetre."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.02)
    ball.apply_translation((0.01, 0.0, -0.24))
    shin = trimesh.creation.box((0.02, 0.02, 0.2))
    shin.apply_translation((0.0, 0.0, -0.12))
    trimesh.util.concatenate([shin, ball]).apply_scale(1000.0).export(tmp_path / 'shin.stl')
    shape = (
        '<collision><geometry><mesh filename="shin.stl" scale="0.001 0.001 0.001"/></geometry>'
        '</collision>'
    )
    text = dog(shape=shape)
    front = parse_description(text.replace('FL_3', 'FL_foot' if named else 'FL_3'),
                              tmp_path / 'dog.urdf').quadruped.legs[0]  # fmt: skip
    assert front.foot_radius == pytest.approx(0.02, abs=0.002)
    lowest = front.foot_centre[2] - front.foot_radius
    assert lowest == pytest.approx(-0.2 - 0.26, abs=1e-3)
    assert front.foot_centre[0] == pytest.approx(0.2 + 0.01, abs=2e-3)


def test_what_is_no_leg_is_held_where_it_is() -> None:
    arm = (
        joint('yaw', 'body', 'turret', '0 0 0.1', '0 0 1')
        + joint('elbow', 'turret', 'hand', '0 0 0.1', '0 1 0', limit='lower="0.5" upper="2"')
        + joint('finger', 'hand', 'claw', '0 0 0.1', '0 1 0', limit='lower="-1" upper="-0.2"')
        + joint('spin', 'body', 'lidar', '0 0 0.2', '0 0 1', kind='continuous', limit='')
        + joint('lift', 'body', 'mast', '0 0 0.2', '0 0 1', kind='prismatic')
    )
    quadruped = found(dog(extra=arm))
    assert quadruped.held == {'yaw': 0.0, 'elbow': 0.5, 'finger': -0.2, 'spin': 0.0, 'lift': 0.0}
    assert quadruped.passed == {
        'yaw': 'the first about x, forward, the others both across it; found '
        'yaw about (0 0 1), elbow about (0 1 0), finger about (0 1 0)',
        'spin': '1 joint instead of 3',
        'lift': 'lift slides',
    }
    assert quadruped.feet == found(dog()).feet


def test_a_finger_that_mimics_goes_with_the_one_it_mimics() -> None:
    fingers = joint('left', 'body', 'one', '0.3 0 0', '0 1 0', limit='lower="0.5" upper="2"')
    fingers += joint('right', 'body', 'two', '0.3 0 0', '0 1 0').replace(
        '<axis', '<mimic joint="left" multiplier="-2" offset="0.1"/><axis'
    )
    assert found(dog(extra=fingers)).held == {'left': 0.5, 'right': -0.9}


def test_legs_without_any_motor_get_the_go2s_as_large_as_they_are() -> None:
    robot = parse_urdf(dog().replace('effort="20" velocity="20"', ''))
    quadruped = find_quadruped(robot)
    scale = scale_of(quadruped)
    equipped, line = equip_legs(robot, quadruped)
    joint = equipped.joints['RR_c']
    assert joint.effort == pytest.approx(35.55 * scale.of('N m'))
    assert joint.velocity == pytest.approx(15.7 * scale.of('rad/s'))
    assert line.startswith('no leg joint has a motor: each gets one of ')
    whole = parse_urdf(dog())
    assert equip_legs(whole, find_quadruped(whole)) == (whole, '')


def test_an_arm_that_is_built_like_a_leg_is_none_for_want_of_a_mirror_image() -> None:
    quadruped = found(dog(extra=leg('arm', 0.3, 0.0)))
    assert quadruped.feet == ('FL_3', 'FR_3', 'RL_3', 'RR_3')
    assert quadruped.passed == {'arm_a': 'no mirror image'}
    assert list(quadruped.held) == ['arm_a', 'arm_b', 'arm_c']


REFUSED: list[tuple[Callable[[], str], str]] = [
    (lambda: dog(''.join(leg(name, *HIPS[name]) for name in ('FL', 'FR', 'RL'))),
     'found 3 limbs on body: FL_a (3 joints), FR_a (3 joints), RL_a (3 joints)'),
    (lambda: dog(''.join(leg(f'{name}{i}', x, y) for i, (name, (x, y)) in
                         enumerate([*HIPS.items(), ('ML', (0, 0.1)), ('MR', (0, -0.1))]))),
     'a robot with 6 legs is none: found 6 limbs on body'),
    (lambda: dog(extra=''.join(joint(f'{name}_w', f'{name}_3', f'{name}_wheel', '0 0 -0.3',
                                     '0 1 0', kind='continuous') for name in HIPS)),
     'wheels at its feet (FL_w, FR_w, RL_w, RR_w) is none: found 4 limbs on body: '
     'FL_a (3 joints and a wheel)'),
    (lambda: dog().replace('<axis', '<mimic joint="FL_b"/><axis', 1),
     'found 4 limbs on body: FL_a (3 joints), FR_a (3 joints), RL_a (3 joints), RR_a (3 joints); '
     'FL_a is no leg: FL_a mimics FL_b: a linkage, not a joint of its own'),
    (lambda: dog(extra=joint('rod', 'FL_1', 'FL_rod', '0 0 0', '0 1 0')),
     'found 4 limbs on body: FL_a (4 joints)'),
    (lambda: dog(''.join(leg(name, *HIPS[name]) for name in ('FL', 'FR')), extra=joint(
        'spine', 'body', 'rump', '-0.2 0 0', '0 0 1') + ''.join(
        leg(name, 0.0, HIPS[name][1]).replace('"body"', '"rump"') for name in ('RL', 'RR'))),
     'spine bends the trunk between legs, make it fixed: found 3 limbs on body: FL_a'),
    (lambda: re.sub(r'(name="\w+_b" type=)"revolute"', r'\1"fixed"', dog()), 'FL_a (2 joints)'),
    (lambda: re.sub(r'(name="\w+_c" type=)"revolute"', r'\1"prismatic"', dog()),
     'four legs of three revolute joints'),
    (lambda: '<robot name="stone"><link name="rock"/></robot>', 'found no movable joint on rock'),
    (lambda: dog(roll='0 1 0'),
     'the first about x, forward, the others both across it; found FL_a about (0 1 0)'),
    (lambda: dog(shape=''), "no foot below joint 'FL_c': FL_3 need a sphere"),
    (lambda: dog(''.join(leg(name, x, 0.05) for name, (x, _) in HIPS.items())),
     'one at each corner, x forward; found hips'),
]  # fmt: skip


@for_all(('make', 'said'), REFUSED)
def test_what_is_no_quadruped_is_refused_with_what_was_found(
    make: Callable[[], str], said: str
) -> None:
    with pytest.raises(NotAQuadruped) as refusal:
        found(make())
    assert said in str(refusal.value)
    assert '\n' not in str(refusal.value)


@for_all('name', ['imu', 'imu_link', 'trunk_imu', 'base_IMU_frame'])
def test_the_imu_is_a_link_on_the_trunk_that_says_so(name: str) -> None:
    robot = parse_urdf(dog(extra=joint('j', 'body', name, '0.1 0 0.02', '1 0 0', kind='fixed')))
    assert find_imu(robot) == name
    np.testing.assert_allclose(imu_position(robot), (0.1, 0.0, 0.02))


def test_an_imu_on_a_foot_is_not_the_robots() -> None:
    robot = parse_urdf(dog(extra=joint('j', 'FL_3', 'imu', '0 0 0', '1 0 0', kind='fixed')))
    assert find_imu(robot) is None
    np.testing.assert_array_equal(imu_position(robot), 0.0)


def test_a_robot_hung_from_the_world_is_seen_from_its_base() -> None:
    tree = ElementTree.fromstring(dog())
    ElementTree.SubElement(tree, 'link', name='world')
    hang = ElementTree.SubElement(tree, 'joint', name='hang', type='fixed')
    ElementTree.SubElement(hang, 'parent', link='world')
    ElementTree.SubElement(hang, 'child', link='body')
    ElementTree.SubElement(hang, 'origin', xyz='0 0 1.5', rpy='0 0 0.7')
    hung = found(ElementTree.tostring(tree, encoding='unicode'))
    for one, other in zip(hung.legs, found(dog()).legs, strict=True):
        np.testing.assert_allclose(one.hip, other.hip, atol=1e-12)
