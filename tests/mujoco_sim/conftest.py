# SPDX-License-Identifier: Apache-2.0
"""Small worlds whose motion is known in closed form."""

from descriptions import robot_named
import mujoco
from mujoco_sim.world import build_world, World
import pytest
from robot_description.description import Description
from robot_description.mujoco.builder import to_mujoco
from robot_description.urdf import parse_urdf

BALL = """
<robot name="ball"><link name="ball"><inertial><mass value="2"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link></robot>
"""


@pytest.fixture(scope='session')
def loaded() -> Description:
    """Return mbot's description."""
    return robot_named('mbot')


@pytest.fixture
def world(loaded: Description) -> World:
    """Return mbot on a flat floor."""
    return build_world(loaded)


@pytest.fixture
def ball() -> World:
    """Return a ball of 2 kg that floats without gravity."""
    spec = to_mujoco(parse_urdf(BALL))
    spec.option.timestep = 0.001
    spec.option.gravity = [0.0, 0.0, 0.0]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    return World(spec, 'ball')
