# SPDX-License-Identifier: Apache-2.0
"""From a robot's name and a world's name to a World."""

from collections.abc import Sequence

import mujoco
from robot_description.description import Description
from robot_description.morphology.quadruped import find_imu
from robot_description.mujoco.builder import add_imu
from robot_description.mujoco.builder import to_mujoco
from wasd_core.errors import DescriptionError

from mujoco_sim.physics import Physics
from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.scene import furnish
from mujoco_sim.world import World


def robot_spec(loaded: Description, setup: RobotSetup, visuals: bool = False) -> mujoco.MjSpec:
    """
    Return a robot with what its setup adds to it, nothing around it.

    Raises:
        DescriptionError: MuJoCo cannot read the robot.
    """
    try:
        spec = to_mujoco(loaded.robot, loaded.meshes.files.get, visuals)
    except DescriptionError as error:
        raise DescriptionError(f'{loaded.path}: {error}') from None
    for joint, inertia in setup.reflected_inertia.items():
        spec.joint(joint).armature = inertia
    if setup.imu and find_imu(loaded.robot) is None:
        add_imu(spec, loaded.robot)
    return spec


def build_world(
    loaded: Description,
    world: str = 'flat',
    seed: int = 0,
    setup: RobotSetup | None = None,
    visuals: bool = False,
) -> World:
    """
    Put a robot into a world; with `visuals`, its meshes are there to be drawn.

    Raises:
        DescriptionError: MuJoCo cannot read the robot.
        SimulationError: there is no such world, or the two do not compile.
    """
    setup = setup or RobotSetup()
    spec = robot_spec(loaded, setup, visuals)
    furnish(spec, world, seed)
    return World(spec, loaded.robot.base, seed, setup)


def build_shared_world(
    robots: Sequence[tuple[str, Description, RobotSetup]],
    world: str = 'flat',
    seed: int = 0,
    visuals: bool = False,
) -> list[World]:
    """
    Put several robots into one world, each with its prefix; their setups say where.

    Raises:
        DescriptionError: MuJoCo cannot read a robot.
        SimulationError: there is no such world, or they do not compile.
    """
    spec = mujoco.MjSpec()
    spec.compiler.fusestatic = True  # as in models that come from a URDF
    for prefix, loaded, setup in robots:
        body = robot_spec(loaded, setup, visuals).body(loaded.robot.base)
        spec.worldbody.add_frame().attach_body(body, prefix, '')
    furnish(spec, world, seed)
    physics = Physics(spec)
    worlds = [
        World(physics, loaded.robot.base, seed, setup, prefix) for prefix, loaded, setup in robots
    ]
    physics.reset()
    return worlds
