# SPDX-License-Identifier: Apache-2.0
"""From a robot's name and a world's name to a World."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
from robot_description.drive_wheels import equipped
from robot_description.errors import DescriptionError
from robot_description.expand import expand
from robot_description.imu import find_imu
from robot_description.inertia import impossible_inertias
from robot_description.mesh_report import MeshReport
from robot_description.mesh_resolver import resolve_meshes
from robot_description.mujoco_model import add_imu
from robot_description.mujoco_model import to_mujoco
from robot_description.robots import description_path
from robot_description.stand_in_masses import with_stand_in_masses
from robot_description.urdf import parse_urdf
from robot_description.urdf import Robot

from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.scene import furnish
from mujoco_sim.world import World


class LoadedRobot(NamedTuple):
    """A robot's description: its file, URDF text and content, and what became of its meshes."""

    path: Path
    urdf: str
    robot: Robot
    meshes: MeshReport

    @property
    def repairs(self) -> tuple[str, ...]:
        """What is not as the description says, in one line each."""
        lines = [record.line() for record in self.meshes.repairs]
        return (*lines, *impossible_inertias(self.robot))

    def with_stand_in_masses(self) -> 'LoadedRobot':
        """Return the robot with a mass for each link, for a world without physics."""
        urdf = with_stand_in_masses(self.urdf)
        return self._replace(urdf=urdf, robot=parse_urdf(urdf))

    def record(self) -> dict[str, Any]:
        """Return where the description is from and what was repaired in it, as JSON has it."""
        return {
            'path': str(self.path),
            'meshes': [record.record() for record in self.meshes.repairs],
            'repairs': list(self.repairs),
        }


def load_robot(
    name_or_path: str,
    search: Sequence[Path] = (),
    arguments: Mapping[str, str] | None = None,
    strict: bool = False,
) -> LoadedRobot:
    """
    Expand and parse a description and find its meshes.

    `search` are folders in which packages are looked for first, `arguments` are xacro arguments;
    with `strict` every mesh has to be where the description says.

    Raises:
        DescriptionError: what is wrong with it, in one line.
    """
    path = description_path(name_or_path)
    urdf = expand(path, arguments, search)
    try:
        robot = equipped(parse_urdf(urdf))
        meshes = resolve_meshes(robot, path, search)
        meshes.check(strict)
    except DescriptionError as error:
        raise DescriptionError(f'{path}: {error}') from None
    return LoadedRobot(path, urdf, robot, meshes)


def robot_spec(loaded: LoadedRobot, setup: RobotSetup, visuals: bool = False) -> mujoco.MjSpec:
    """
    Return a robot with what its setup adds to it, nothing around it.

    Raises:
        DescriptionError: MuJoCo cannot read the robot.
    """
    try:
        spec = to_mujoco(loaded.urdf, loaded.robot, loaded.meshes.files.get, visuals)
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
