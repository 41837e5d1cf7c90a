# SPDX-License-Identifier: Apache-2.0
"""Joints of what is no leg stay where they are, whatever hangs on them, until they are told."""

from pathlib import Path

from cases import for_all
from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.world import build_world, World
import numpy as np
import pytest
from robot_description.description import parse_description
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
