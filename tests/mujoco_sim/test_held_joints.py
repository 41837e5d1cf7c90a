# SPDX-License-Identifier: Apache-2.0
"""Joints of what is no leg stay where they are, whatever hangs on them, until they are told."""

from pathlib import Path

from cases import for_all
from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.world import build_world, World
import numpy as np
import pytest
from robot_description.description import parse_description
from robot_description.morphology.equip_wheels import held_joints
from robot_description.morphology.wheels import find_drive
from wasd_core.robot_io import JointCommand

HOLD = -0.4
INERTIAL = (
    '<inertial><origin xyz="{} 0 0"/><mass value="{}"/>'
    '<inertia ixx="{}" iyy="{}" izz="{}" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def inertial(mass: float, radius: float, place: float = 0.0) -> str:
    """Return the inertial of a ball."""
    moment = 0.4 * mass * radius**2
    return INERTIAL.format(place, mass, moment, moment, moment)


def arm_on_a_block(mass: float) -> World:
    """Put a block on the floor with an arm 0.4 m long, which is in the block's way."""
    text = (
        f'<robot name="r"><link name="block">{inertial(50.0, 0.25)}<collision><geometry>'
        '<box size="0.5 0.5 0.1"/></geometry></collision></link>'
        f'<link name="arm">{inertial(mass, 0.05, 0.4)}<collision><origin xyz="0.2 0 0"/><geometry>'
        '<box size="0.4 0.05 0.05"/></geometry></collision></link>'
        '<joint name="elbow" type="revolute"><parent link="block"/><child link="arm"/>'
        '<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1000" velocity="9"/></joint>'
        '</robot>'
    )
    setup = RobotSetup(height=0.05, joint_positions={'elbow': HOLD}, held={'elbow': HOLD})
    return build_world(parse_description(text, Path('r.urdf')), setup=setup)


@for_all('mass', [0.01, 0.5, 20.0])
def test_a_held_joint_stays_whatever_hangs_on_it(mass: float) -> None:
    world = arm_on_a_block(mass)
    positions = []
    for _ in range(100):
        world.step(10)
        positions.append(world.joints().position[0])
    np.testing.assert_allclose(positions, HOLD, atol=0.005)


def test_a_held_joint_obeys_a_command_from_then_on_until_a_reset() -> None:
    world = arm_on_a_block(0.5)
    zero, one = np.zeros(1), np.ones(1)
    world.apply(JointCommand(zero, zero, zero, zero, zero))
    world.step(500)
    assert world.joints().position[0] == pytest.approx(HOLD, abs=0.005)
    world.apply(JointCommand(-one, zero, zero, 100.0 * one, 10.0 * one))
    world.step(1500)
    assert world.joints().position[0] == pytest.approx(-1.0, abs=0.1)
    world.reset()
    world.step(500)
    assert world.joints().position[0] == pytest.approx(HOLD, abs=0.005)


def part(name: str, parent: str, kind: str, origin: str, axis: str, shape: str) -> str:
    """Return a link of a kilogram on a joint with a motor."""
    return (
        f'<link name="{name}">{inertial(1.0, 0.1)}<collision>'
        f'<origin rpy="1.5707963 0 0"/><geometry>{shape}</geometry></collision></link>'
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{name}"/>'
        f'<origin xyz="{origin}"/><axis xyz="{axis}"/>'
        '<limit lower="-2" upper="2" effort="40" velocity="9"/></joint>'
    )


def test_continuous_joints_of_an_arm_are_held_and_those_of_wheels_and_casters_are_not() -> None:
    box, wheel = '<box size="0.05 0.3 0.05"/>', '<cylinder radius="0.1" length="0.04"/>'
    text = (
        f'<robot name="r"><link name="base">{inertial(9.0, 0.2)}<collision><geometry>'
        '<box size="0.5 0.3 0.1"/></geometry></collision></link>'
        + part('left', 'base', 'continuous', '0 0.2 0', '0 1 0', wheel)
        + part('right', 'base', 'continuous', '0 -0.2 0', '0 1 0', wheel)
        + part('swivel', 'base', 'continuous', '-0.25 0 -0.03', '0 0 1', '<sphere radius="0.01"/>')
        + part('caster', 'swivel', 'continuous', '-0.02 0 -0.03', '0 1 0',
               '<cylinder radius="0.04" length="0.02"/>')
        + part('shoulder', 'base', 'continuous', '0.1 0 0.1', '0 1 0', box)
        + part('elbow', 'shoulder', 'revolute', '0 0 0.3', '0 1 0', box)
        + '</robot>'
    )  # fmt: skip
    robot = parse_description(text, Path('r.urdf')).robot
    drive = find_drive(robot)
    assert [each.joint.name for each in drive.wheels] == ['left', 'right']
    assert held_joints(robot, drive) == {'shoulder': 0.0, 'elbow': 0.0}
