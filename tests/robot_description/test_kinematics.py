# SPDX-License-Identifier: Apache-2.0
"""MuJoCo, Pinocchio and yourdfpy put the same robot in the same place, with the same mass."""

from dataclasses import replace
import math
from pathlib import Path

from cases import for_all
from descriptions import robot_named
import numpy as np
import pinocchio as pin
import pytest
from robot_description.description import load_robot, parse_description, read_description
from robot_description.info import _any_position, check_kinematics
from robot_description.mujoco.builder import to_mujoco
from robot_description.packages import description_path, share_directory
from robot_description.pinocchio_model import configuration, link_positions, to_pinocchio
from robot_description.urdf import parse_urdf
from wasd_core.errors import DescriptionError

ROBOTS = share_directory('example-robot-data') / 'robots'
OTHERS = [f'{name}_description/urdf/{name}.urdf' for name in ('a1', 'go1', 'go2', 'b1', 'z1')]
FEET = ('FL_foot', 'FR_foot', 'RL_foot', 'RR_foot')


@pytest.mark.slow
@pytest.mark.parametrize('name', ['go2', 'mbot', *(str(ROBOTS / other) for other in OTHERS)])
def test_every_link_is_where_the_urdf_says_in_three_libraries(name):
    deviations = check_kinematics(load_robot(name))
    assert [deviation.library for deviation in deviations] == ['MuJoCo', 'Pinocchio', 'yourdfpy']
    assert max(deviation.distance for deviation in deviations) < 1e-6


@pytest.mark.slow
def test_a_wrong_link_is_found():
    loaded = robot_named('go2')
    shifted = replace(loaded, urdf=loaded.urdf.replace('-0.213"', '-0.214"'))
    deviations = check_kinematics(shifted)
    assert all(deviation.distance > 9e-4 for deviation in deviations)


@pytest.fixture(scope='module')
def go2():
    loaded = robot_named('go2')
    return loaded.robot, to_pinocchio(loaded)


@pytest.mark.slow
def test_pinocchio_has_mujocos_joints_and_the_urdfs_mass(go2):
    robot, model = go2
    assert (model.nq, model.nv) == (19, 18)
    assert set(list(model.names)[2:]) == {joint.name for joint in robot.movable_joints}
    assert model.names[1] == 'root'
    assert pin.computeTotalMass(model) == pytest.approx(robot.mass, abs=1e-6)


@pytest.mark.slow
def test_a_configuration_goes_by_name_whatever_the_order(go2):
    robot, model = go2
    positions = {joint.name: 0.1 * i for i, joint in enumerate(robot.movable_joints, start=1)}
    q = configuration(model, dict(reversed(positions.items())))
    for name, position in positions.items():
        assert q[model.joints[model.getJointId(name)].idx_q] == position
    places, poses = link_positions(model, q), robot.link_poses(positions)
    for foot in FEET:
        np.testing.assert_allclose(places[foot], poses[foot].position, atol=1e-12)


def test_a_joint_without_limits_is_a_cosine_and_a_sine():
    model = to_pinocchio(robot_named('mbot'))
    q = configuration(model, {'left_wheel_joint': math.pi / 2})
    joint = model.joints[model.getJointId('left_wheel_joint')]
    np.testing.assert_allclose(q[joint.idx_q : joint.idx_q + 2], [0.0, 1.0], atol=1e-15)


@pytest.mark.slow
def test_a_robot_that_hangs_on_the_world_is_fixed_in_pinocchio_too():
    hung = read_description(description_path('go2'), arguments={'DEBUG': 'true'})
    assert to_pinocchio(hung).nq == 12
    assert max(deviation.distance for deviation in check_kinematics(hung)) < 1e-6


def test_what_moves_freely_in_a_world_does_in_pinocchio_too():
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    urdf = (
        f'<robot name="r"><link name="world"/><link name="a">{body}</link>'
        f'<link name="b">{body}</link><joint name="j" type="planar"><origin xyz="0 0 1"/>'
        '<parent link="world"/><child link="a"/></joint><joint name="k" type="continuous">'
        '<origin xyz="1 0 0"/><parent link="a"/><child link="b"/></joint></robot>'
    )
    read = parse_description(urdf, Path('r.urdf'))
    for for_control, count in ((False, 9), (True, 8)):
        model = to_pinocchio(read, for_control=for_control)
        assert (model.nq, pin.computeTotalMass(model)) == (count, 2.0)
        assert list(model.names[1:]) == ['root', 'k']
    pytest.importorskip('yourdfpy')
    assert max(deviation.distance for deviation in check_kinematics(read)) < 1e-12


@pytest.mark.slow
def test_for_control_a_robot_is_free_and_each_joint_one_number():
    hung = read_description(description_path('go2'), arguments={'DEBUG': 'true'})
    assert (to_pinocchio(hung, for_control=True).nq, to_pinocchio(hung).nq) == (19, 12)
    wheeled = robot_named('mbot')
    turning = len(wheeled.robot.movable_joints)  # none has limits
    assert to_pinocchio(wheeled).nq == 7 + 2 * turning
    assert to_pinocchio(wheeled, for_control=True).nq == 7 + turning


@for_all('kind, lower, upper', [('revolute', 4, 5), ('prismatic', -2, -0.6)])
def test_a_range_far_from_zero_is_tried_too(kind, lower, upper):
    pytest.importorskip('yourdfpy')
    urdf = (
        f'<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="{kind}">'
        '<parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
        f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/></joint></robot>'
    )
    deviations = check_kinematics(parse_description(urdf, Path('r.urdf')))
    assert max(deviation.distance for deviation in deviations) < 1e-12


def test_poses_are_drawn_between_the_stops():
    joint = '<joint name="j" type="revolute"><parent link="a"/><child link="b"/>'
    limit = '<limit lower="-0.5" upper="0.5" effort="1" velocity="1"/></joint>'
    read = parse_urdf(f'<robot><link name="a"/><link name="b"/>{joint}{limit}</robot>')
    random = np.random.default_rng(0)
    drawn = [_any_position(read.joints['j'], random) for _ in range(50)]
    assert np.std(drawn) == pytest.approx(1.0 / math.sqrt(12.0), rel=0.1)
    assert max(map(abs, drawn)) < 0.5


def test_a_mass_without_an_inertia_is_a_mass_in_pinocchio_too():
    load = "<inertial><mass value='6'/></inertial>"
    read = parse_description(f"<robot><link name='a'>{load}</link></robot>", Path('r.urdf'))
    assert pin.computeTotalMass(to_pinocchio(read)) == read.robot.mass == 6.0


def test_what_pinocchio_cannot_read_is_one_line():
    read = parse_description('<robot name="r"><link name="a"/></robot>', Path('r.urdf'))
    with pytest.raises(DescriptionError, match='^Pinocchio: ') as caught:
        to_pinocchio(replace(read, urdf='<robot name="r"></robot>'))
    assert '\n' not in str(caught.value)


def test_what_one_reader_refuses_and_the_other_does_not_loads_in_all():
    # No limit, no name, a repeated tag, an inertia in part: Pinocchio's reader or MuJoCo's would
    # each refuse some of it.
    mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    axis = '<axis xyz="0 1 0"/><axis xyz="1 0 0"/>'
    urdf = (
        f'<robot><link name="a">{mass}</link><link name="b">{mass}<inertial/></link>'
        '<link name="c"><inertial><mass value="0"/></inertial></link>'
        f'<joint name="j" type="revolute"><parent link="a"/><child link="b"/>{axis}</joint>'
        '<joint name="k" type="fixed"><parent link="b"/><child link="c"/>'
        '<origin xyz="0 0 1"/></joint></robot>'
    )
    read = parse_description(urdf, Path('r.urdf'))
    assert to_pinocchio(read).nq == 8
    assert to_mujoco(read.robot).compile().nq == 8
    pytest.importorskip('yourdfpy')
    assert max(deviation.distance for deviation in check_kinematics(read)) < 1e-12
