# SPDX-License-Identifier: Apache-2.0
"""From a robot's name and a world's name to a World."""

from collections.abc import Mapping, Sequence
import logging
from pathlib import Path

import mujoco
from robot_description.description import Description
from robot_description.description import parse_description
from robot_description.description import read_description
from robot_description.drive_wheels import equipped
from robot_description.errors import DescriptionError
from robot_description.imu import find_imu
from robot_description.mujoco.builder import add_imu
from robot_description.mujoco.builder import to_mujoco
from robot_description.robots import description_path

from mujoco_sim.physics import Physics
from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.scene import furnish
from mujoco_sim.world import World

# Without a handler Python writes warnings to standard error, a line each.
LOGGER = logging.getLogger(__name__)
LoadedRobot = Description


def load_robot(
    name_or_path: str,
    search: Sequence[Path] = (),
    arguments: Mapping[str, str] | None = None,
    strict: bool = False,
    urdf: str | None = None,
) -> LoadedRobot:
    """
    Expand and parse a description and find its meshes, all that something collides with.

    `search` are folders in which packages are looked for first, `arguments` are xacro arguments;
    with `strict` every mesh has to be where the description says; else repairs are logged. A
    `urdf` text is taken in place of the file, which may have gone.

    Raises:
        DescriptionError: what is wrong with it, in one line.
    """
    if urdf is not None:
        loaded = parse_description(urdf, Path(name_or_path), search)
    else:
        loaded = read_description(description_path(name_or_path), search, arguments)
    try:
        loaded.meshes.check(strict)
    except DescriptionError as error:
        raise DescriptionError(f'{loaded.path}: {error}') from None
    for line in (*loaded.warnings, *loaded.repairs):
        LOGGER.warning('description: %s', line)
    return loaded._replace(robot=equipped(loaded.robot))


def robot_spec(loaded: LoadedRobot, setup: RobotSetup, visuals: bool = False) -> mujoco.MjSpec:
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
    loaded: LoadedRobot,
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
    robots: Sequence[tuple[str, LoadedRobot, RobotSetup]],
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
