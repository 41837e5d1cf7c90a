# SPDX-License-Identifier: Apache-2.0
import math

from cases import for_all
from descriptions import robot_named
from diff_drive_sim.drive import configure_wheels, DiffDrive
from diff_drive_sim.odometry import DiffDriveError, DiffDriveGeometry, find_wheels
from diff_drive_sim.parameters import DiffDriveParameters, WheelParameters
import pytest
from robot_description.morphology.wheels import WheelChoice
from robot_description.urdf import parse_urdf


def wheel(name, y, x=0.0, radius=0.06, axis='0 1 0', rpy='0 0 0', kind='continuous', limit=''):
    # The cylinder's own axis is that of the joint.
    turn = '1.5707963267948966 0 0' if axis.split()[1] != '0' else '0 0 0'
    return (
        f'<link name="{name}"><collision><origin rpy="{turn}"/><geometry>'
        f'<cylinder radius="{radius}" length="0.02"/>'
        f'</geometry></collision></link><joint name="{name}_joint" type="{kind}">'
        f'<origin xyz="{x} {y} 0" rpy="{rpy}"/><parent link="base"/><child link="{name}"/>'
        f'<axis xyz="{axis}"/>{limit}</joint>'
    )


def robot(*wheels):
    return parse_urdf(f'<robot name="cart"><link name="base"/>{"".join(wheels)}</robot>')


def test_mbot_has_a_track_of_38_cm_and_wheels_of_6_cm():
    geometry = find_wheels(robot_named('mbot').robot)
    assert (geometry.left_joint, geometry.right_joint) == ('left_wheel_joint', 'right_wheel_joint')
    assert geometry.wheel_separation == pytest.approx(0.38, abs=1e-12)
    assert geometry.wheel_radius == 0.06
    assert (geometry.left_direction, geometry.right_direction) == (1, 1)
    assert (geometry.axle_x, geometry.axle_y) == (0.0, 0.0)
    assert geometry.speed_limit == 25.0


def test_the_middle_of_the_axle_is_found():
    geometry = find_wheels(robot(wheel('l', 0.25, x=0.09), wheel('r', -0.15, x=0.09)))
    assert (geometry.axle_x, geometry.axle_y) == pytest.approx((0.09, 0.05))
    assert geometry.wheel_separation == pytest.approx(0.4)


def let_go(world):
    text = ''.join((wheel('l', 0.25, x=0.09), wheel('r', -0.15, x=0.09)))
    return parse_urdf(
        f'<robot name="cart"><link name="{world}"/><link name="base"/>{text}<joint name="free" '
        f'type="planar"><origin xyz="1 2 0.06" rpy="0 0 3"/><parent link="{world}"/>'
        '<child link="base"/></joint></robot>'
    )


@for_all('world', ['world', 'odom'])
def test_what_a_world_lets_go_is_the_base_and_not_the_world(world):
    unit = DiffDrive(let_go(world), DiffDriveParameters())
    assert unit.parameters.base_frame_id == 'base'
    geometry = unit.controller.geometry
    assert (geometry.axle_x, geometry.axle_y) == pytest.approx((0.09, 0.05))


def test_the_slower_wheel_sets_the_speed_limit_and_none_is_no_limit():
    slow, fast = (f'<limit effort="1" velocity="{speed}"/>' for speed in (9.0, 12.0))
    wheels = robot(wheel('l', 0.2, limit=fast), wheel('r', -0.2, limit=slow))
    assert find_wheels(wheels).speed_limit == 9.0
    assert find_wheels(robot(wheel('l', 0.2), wheel('r', -0.2))).speed_limit == math.inf


def test_left_is_the_wheel_on_the_left_whatever_its_name():
    geometry = find_wheels(robot(wheel('left', -0.2), wheel('right', 0.2)))
    assert (geometry.left_joint, geometry.right_joint) == ('right_joint', 'left_joint')


def test_swapped_names_are_said():
    geometry = find_wheels(robot(wheel('left', -0.2), wheel('right', 0.2)))
    _, notes = configure_wheels(geometry, WheelParameters())
    assert notes == (
        'right_joint is on the left and left_joint on the right: their names are swapped',
    )
    assert configure_wheels(find_wheels(robot_named('mbot').robot), WheelParameters())[1] == ()


def test_a_file_that_names_the_right_wheel_as_the_left_one_is_told():
    geometry = find_wheels(robot(wheel('l', 0.2), wheel('r', -0.2)))
    for left, right, said in (('l', 'r', False), ('r', 'l', True)):
        parameters = WheelParameters(
            left_wheel_names=(f'{left}_joint',), right_wheel_names=(f'{right}_joint',)
        )
        used, notes = configure_wheels(geometry, parameters)
        assert (used.left_joint, used.right_joint) == ('l_joint', 'r_joint')
        line = (
            'left_wheel_names names r_joint, which is on the right: l_joint is taken as the left '
            'one'
        )
        assert notes == (line,) * said


def test_a_calibration_corrects_each_wheel_and_the_track():
    parameters = WheelParameters(
        wheel_separation_multiplier=1.1,
        left_wheel_radius_multiplier=1.02,
        right_wheel_radius_multiplier=0.98,
    )
    geometry, notes = configure_wheels(find_wheels(robot_named('mbot').robot), parameters)
    assert notes == ()
    assert geometry.wheel_speeds(0.3, 0.0) == pytest.approx((5.0 / 1.02, 5.0 / 0.98))
    # A turn in place: each wheel goes half the corrected track times the angle.
    path = 0.5 * 1.1 * 0.38
    assert geometry.wheel_speeds(0.0, 1.0)[1] == pytest.approx(path / (0.98 * 0.06))
    assert geometry.displacement(*geometry.wheel_speeds(0.2, -0.7)) == pytest.approx((0.2, -0.7))


def test_a_wheel_whose_axis_points_right_turns_backward_to_go_forward():
    geometry = find_wheels(robot(wheel('l', 0.2), wheel('r', -0.2, axis='0 -1 0')))
    forward = geometry.wheel_speeds(0.3, 0.0)
    assert forward == pytest.approx((5.0, 5.0))
    joints = geometry.flip(forward)
    assert joints == pytest.approx((5.0, -5.0))
    assert geometry.flip(joints) == forward
    assert geometry.displacement(*forward) == pytest.approx((0.3, 0.0))


def test_a_wheel_may_be_turned_into_place_by_its_joint():
    # The usual form of exporters: the axis is z, the joint's frame is rolled.
    quarter = '-1.5707963267948966 0 0'
    wheels = (wheel(name, y, axis='0 0 1', rpy=quarter) for name, y in (('l', 0.2), ('r', -0.2)))
    geometry = find_wheels(robot(*wheels))
    assert (geometry.left_direction, geometry.right_direction) == (1, 1)


@for_all(
    ('wheels', 'message'),
    [
        ((), "'cart' has no two driven wheels on one axle: none of its joints turns freely"),
        ((wheel('l', 0.2),), 'l_joint is alone: no second wheel beside it'),
        (
            (wheel('l', 0.2), wheel('r', -0.2), wheel('x', 0.1)),
            r'a skid-steer \(l_joint, x_joint, r_joint are driven alike\)',
        ),
        ((wheel('l', 0.2), wheel('r', -0.2, kind='fixed')), 'l_joint is alone'),
        (
            (wheel('l', 0.2), wheel('r', -0.2, axis='1 0 0')),
            r'r_joint has its axis 90 degrees off y \(1 are taken\); l_joint is alone',
        ),
        (
            (wheel('l', 0.2), wheel('r', -0.2, axis='0.02 1 0')),
            r'r_joint has its axis 1.15 degrees off y \(1 are taken\)',
        ),
        (
            (wheel('l', 0.2), wheel('r', -0.2, radius=0.05)),
            'l_joint has a radius of 0.06 m, r_joint one of 0.05 m, 16.7 % apart',
        ),
        (
            (wheel('l', 0.2), wheel('r', -0.2, x=0.0021)),
            r'l_joint is 2.1 mm off the axle of r_joint \(2 mm are taken\)',
        ),
        ((wheel('l', 0.2), wheel('r', 0.2)), 'l_joint is where r_joint is'),
        (
            (wheel('l', 0.2, radius=0.0), wheel('r', -0.2, radius=0.0)),
            'l_joint has a cylinder without a radius',
        ),
        (
            (wheel('l', 0.2, limit='<mimic joint="r_joint"/>'), wheel('r', -0.2)),
            "l_joint mimics 'r_joint'",
        ),
    ],
)
def test_wheels_that_do_not_make_a_differential_drive_are_named(wheels, message):
    with pytest.raises(DiffDriveError, match=message):
        find_wheels(robot(*wheels))


@for_all('choice', [WheelChoice(), WheelChoice(('l_joint', 'r_joint'), 0.06)])
def test_a_robot_that_looks_along_y_is_told_to_turn_its_root_and_not_to_name_its_wheels(choice):
    quarter = '0 0 1.5707963267948966'
    left, right = (wheel(n, 0.0, x=x, rpy=quarter) for n, x in (('l', -0.2), ('r', 0.2)))
    with pytest.raises(DiffDriveError, match='turn its root by 90 degrees') as refusal:
        find_wheels(robot(left, right), choice)
    assert 'wheel_names' not in str(refusal.value)


def test_named_wheels_are_refused_by_the_limit_that_counts_for_them():
    names = WheelChoice(('l_joint', 'r_joint'))
    leaning = wheel('r', -0.2, axis='1.5 1 0')
    with pytest.raises(DiffDriveError, match=r'56.3 degrees off y \(45 are taken\)'):
        find_wheels(robot(wheel('l', 0.2), leaning), names)


def test_smaller_wheels_beside_each_other_are_casters():
    small = [wheel(name, y, x=-0.1, radius=0.03) for name, y in (('a', 0.1), ('b', -0.1))]
    geometry = find_wheels(robot(*small, wheel('l', 0.2), wheel('r', -0.2)))
    assert (geometry.left_joint, geometry.right_joint) == ('l_joint', 'r_joint')


def test_a_caster_on_a_swivel_is_no_wheel():
    swivel = (
        '<link name="fork"/><joint name="swivel" type="continuous"><parent link="base"/>'
        '<child link="fork"/><axis xyz="0 0 1"/></joint>'
    )
    caster = wheel('c', 0.0, x=-0.02).replace('parent link="base"', 'parent link="fork"')
    geometry = find_wheels(robot(swivel, caster, wheel('l', 0.2), wheel('r', -0.2)))
    assert (geometry.left_joint, geometry.right_joint) == ('l_joint', 'r_joint')


@for_all(
    ('off', 'said'),
    [(0.01, "0_joint is a gear on 'ring_joint'"), (0.04, 'ring_joint has 4 rollers')],
)
def test_gears_around_an_axle_are_neither_wheels_nor_the_rollers_of_an_omni_wheel(off, said):
    small = [
        wheel(f'{n}', 0.01 * n, off, radius=0.015).replace('link="base"', 'link="ring"')
        for n in range(4)
    ]
    with pytest.raises(DiffDriveError, match=said):
        find_wheels(robot(wheel('ring', 0.0, radius=0.05), *small))


@for_all('step', [1, -1])
def test_rollers_count_on_a_hub_that_a_shaft_turns_in_any_order_of_the_file(step):
    hub = wheel('hub', 0.0, radius=0.05).replace('link="base"', 'link="shaft"')
    small = [
        wheel(f'{n}', 0.01 * n, 0.04, radius=0.01).replace('link="base"', 'link="hub"')
        for n in range(4)
    ]
    with pytest.raises(DiffDriveError, match='shaft_joint has 4 rollers'):
        find_wheels(robot(*[wheel('shaft', 0.0, radius=0.02), hub, *small][::step]))


def test_of_four_alike_the_names_choose():
    four = [wheel(f'{end}{side}', y, x) for end, x in (('f', 0.1), ('b', -0.1))
            for side, y in (('l', 0.2), ('r', -0.2))]  # fmt: skip
    with pytest.raises(DiffDriveError, match='skid-steer .*; left_wheel_names, right_wheel_names'):
        find_wheels(robot(*four))
    geometry = find_wheels(robot(*four), WheelChoice(('bl_joint', 'br_joint')))
    assert (geometry.left_joint, geometry.right_joint) == ('bl_joint', 'br_joint')
    assert geometry.axle_x == -0.1


def test_a_name_that_is_no_joint_is_said_with_those_that_are():
    with pytest.raises(DiffDriveError, match="no joint 'left'; it has l_joint, r_joint"):
        find_wheels(robot(wheel('l', 0.2), wheel('r', -0.2)), WheelChoice(('left', 'right')))


def test_wheels_that_are_only_drawn_are_wheels():
    drawn = (wheel(name, y).replace('collision', 'visual') for name, y in (('l', 1), ('r', -1)))
    assert find_wheels(robot(*drawn)).wheel_separation == 2.0


@for_all('tag', ['collision', 'visual'])
def test_a_wheel_is_as_large_as_its_tyre_wherever_the_file_has_its_hub(tag):
    left, right, small = wheel('l', 0.2), wheel('r', -0.2), wheel('l', 0.2, radius=0.02)
    hub = small[small.index('<collision>') : small.index('</link>')]
    rim = left[: left.index('<joint')].replace('"l"', '"rim"')
    weld = '<joint name="weld"><parent link="l"/><child link="rim"/></joint>'
    hub_first, hub_last = (left.replace(at, hub + at) for at in ('<collision>', '</link>'))
    for each in (hub_first, hub_last, small + rim + weld):
        text = (each + right).replace('collision', tag)
        assert find_wheels(robot(text)).wheel_radius == 0.06


def test_a_wheel_that_is_only_drawn_is_larger_than_the_hub_that_collides():
    left, right, small = wheel('l', 0.2), wheel('r', -0.2), wheel('l', 0.2, radius=0.02)
    drawn = left.replace('collision', 'visual')
    hub = small[: small.index('<joint')].replace('"l"', '"hub"')
    weld = '<joint name="weld"><parent link="l"/><child link="hub"/></joint>'
    assert find_wheels(robot(drawn + hub + weld + right)).wheel_radius == 0.06


def test_wheels_may_be_balls():
    ball = [
        wheel(name, y).replace('cylinder radius="0.06" length="0.02"', 'sphere radius="0.05"')
        for name, y in (('l', 0.2), ('r', -0.2))
    ]
    assert find_wheels(robot(*ball)).wheel_radius == 0.05


@for_all('directions', [(1, 1), (-1, 1), (-1, -1)])
@for_all(('linear', 'angular'), [(0.5, 0.0), (0.0, 2.0), (-0.3, 1.1)])
def test_displacement_undoes_wheel_speeds(directions, linear, angular):
    geometry = DiffDriveGeometry('l', 'r', 0.06, 0.38, *directions)
    joints = geometry.flip(geometry.wheel_speeds(linear, angular))
    assert geometry.displacement(*geometry.flip(joints)) == pytest.approx(
        (linear, angular), abs=1e-15
    )


def test_a_left_turn_lets_the_right_wheel_go_faster(geometry):
    left, right = geometry.wheel_speeds(0.0, 1.0)
    # 1 rad/s on half the track, on the radius.
    assert (left, right) == pytest.approx((-0.19 / 0.06, 0.19 / 0.06))


def test_a_separation_that_has_been_calibrated_is_used_without_a_word():
    parameters = WheelParameters(wheel_separation=0.26, wheel_separation_multiplier=1.461538)
    geometry, notes = configure_wheels(find_wheels(robot_named('mbot').robot), parameters)
    assert notes == ()
    assert geometry.wheel_separation == pytest.approx(0.38, abs=1e-6)


MODES = {
    'float': DiffDriveParameters(),
    'ticks': DiffDriveParameters(odometry_feedback='ticks'),
    'arbotix': DiffDriveParameters(mode='arbotix'),
    'legacy': DiffDriveParameters(mode='arbotix', legacy=True),
}


@pytest.mark.slow
@pytest.mark.parametrize('parameters', MODES.values(), ids=MODES)
def test_a_drive_is_the_same_whichever_way_a_joint_counts(parameters):
    urdf = robot_named('mbot').urdf
    before, right = urdf.split('<joint name="right_wheel_joint"')
    other = before + '<joint name="right_wheel_joint"' + right.replace('0 1 0', '0 -1 0', 1)
    plain, flipped = (DiffDrive(parse_urdf(text), parameters) for text in (urdf, other))
    for unit in (plain, flipped):
        unit.controller.command(0.3, 0.8)
    for step in range(200):
        angles = 0.02 * step, 0.025 * step
        left, right = plain.step(*angles, 0.005)
        assert flipped.step(angles[0], -angles[1], 0.005) == (left, -right)
    assert plain.controller.odometry_state == flipped.controller.odometry_state
    assert plain.controller.odometry_state.x > 0.0
    assert plain.ticks == flipped.ticks
