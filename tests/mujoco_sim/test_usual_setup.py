# SPDX-License-Identifier: Apache-2.0
"""A quadruped begins lying, with real motors and sensors; other robots as they are."""

from pathlib import Path

from descriptions import robot_named
from mujoco_sim.robot_setup import COMMAND_DELAY, RobotSetup, usual_setup
from mujoco_sim.world import build_world
import numpy as np
import pytest
from robot_description.description import parse_description
from wasd_bringup.run.legged import standing_pose

pytestmark = pytest.mark.slow


@pytest.fixture(scope='module')
def go2():
    return robot_named('go2')


@pytest.fixture(scope='module')
def mbot():
    return robot_named('mbot')


def test_mbot_is_put_into_the_world_as_it_is(mbot):
    resting = dict.fromkeys((joint.name for joint in mbot.robot.movable_joints), 0.0)
    assert usual_setup(mbot) == RobotSetup(joint_positions=resting)


def test_joints_begin_within_their_stops_and_where_what_they_mimic_has_them():
    def joint(name, limit, mimic=''):
        body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
        return (
            f'<link name="{name}_link">{body}</link><joint name="{name}" type="revolute">'
            f'<parent link="base"/><child link="{name}_link"/><axis xyz="0 0 1"/>'
            f'<limit {limit}/>{mimic}</joint>'
        )

    stops = 'lower="-9" upper="9" effort="5" velocity="1"'
    read = parse_description(
        '<robot name="r"><link name="base"/>'
        + joint('b', stops, '<mimic joint="c" multiplier="2"/>')
        + joint('c', stops, '<mimic joint="a" offset="1"/>')
        + joint('a', 'lower="0.5" upper="2" effort="0" velocity="1"')
        + '</robot>',
        Path('r.urdf'),
    )
    world = build_world(read, setup=usual_setup(read))
    world.step(50)
    joints = world.joints()
    found = dict(zip(world.joint_names, joints.position.tolist(), strict=True))
    begin = {'a': 0.5, 'b': 3.0, 'c': 1.5}
    assert found == pytest.approx(begin, abs=1e-6)
    assert standing_pose(read.robot) == begin  # of one that a hoist holds


def test_a_robot_stands_on_what_is_lowest_where_its_joints_begin():
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    foot = '<collision><geometry><sphere radius="0.05"/></geometry></collision>'
    read = parse_description(
        f'<robot name="r"><link name="base">{body}</link><link name="foot">{body}{foot}</link>'
        '<joint name="j" type="prismatic"><parent link="base"/><child link="foot"/>'
        '<axis xyz="0 0 -1"/><limit lower="0.1" upper="0.3" effort="0" velocity="1"/></joint>'
        '</robot>',
        Path('r.urdf'),
    )
    assert build_world(read, setup=usual_setup(read)).base().position[2] == pytest.approx(0.15)


def test_what_mimics_a_joint_of_a_leg_begins_where_that_does(go2):
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    read = parse_description(
        go2.urdf.replace(
            '</robot>',
            f'<link name="dial">{body}</link><joint name="dial" type="continuous">'
            '<parent link="base"/><child link="dial"/><axis xyz="0 1 0"/>'
            '<mimic joint="FL_calf_joint" multiplier="2"/></joint></robot>',
        ),
        go2.path,
    )
    begin = usual_setup(read).joint_positions
    assert begin['dial'] == 2.0 * begin['FL_calf_joint']


def test_what_floats_on_a_world_is_put_on_the_floor_wherever_its_joint_has_it():
    body = (
        '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
        '<collision><geometry><sphere radius="0.05"/></geometry></collision>'
    )
    read = parse_description(
        f'<robot name="r"><link name="world"/><link name="base">{body}</link><joint name="j" '
        'type="floating"><origin xyz="0 0 0.05"/><parent link="world"/><child link="base"/>'
        '</joint></robot>',
        Path('r.urdf'),
    )
    assert build_world(read, setup=usual_setup(read)).base().position[2] == pytest.approx(0.05)


def test_the_go2_has_noise_a_delay_and_speed_limits(go2):
    setup = usual_setup(go2)
    assert setup.noise is not None
    assert setup.command_delay == COMMAND_DELAY == 0.002
    assert setup.speed_limits['FL_thigh_joint'] == 30.1
    assert len(setup.speed_limits) == 12


def test_without_noise_motors_and_delay_stay_real(go2):
    setup = usual_setup(go2, noise=False)
    assert setup.noise is None
    assert setup.command_delay == COMMAND_DELAY
    assert len(setup.speed_limits) == 12


def test_it_lies_on_the_floor_with_its_legs_folded(go2):
    world = build_world(go2, setup=usual_setup(go2, noise=False))
    angles = dict(zip(world.joint_names, world.joints().position, strict=True))
    for leg in ('FL', 'FR', 'RL', 'RR'):
        assert angles[f'{leg}_hip_joint'] == 0.0
        assert angles[f'{leg}_thigh_joint'] == 1.36
        assert angles[f'{leg}_calf_joint'] == -2.65
    before = world.base().position.copy()
    world.step(2000)  # with slack motors: it lies, and neither falls nor jumps
    after = world.base()
    assert after.position[2] < 0.15
    np.testing.assert_allclose(after.position, before, atol=0.06)
    assert after.tilt < 0.15
    np.testing.assert_allclose(after.linear_velocity, 0.0, atol=0.01)


def test_reset_puts_it_back(go2):
    world = build_world(go2, setup=usual_setup(go2))
    before = world.data.qpos.copy()
    world.push((0.0, 300.0, 200.0), 0.2)
    world.step(600)
    assert abs(world.base().position[1]) > 0.1
    world.reset()
    np.testing.assert_array_equal(world.data.qpos, before)
