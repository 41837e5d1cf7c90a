# SPDX-License-Identifier: Apache-2.0
"""From a robot's name and a world's name to a World."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from robot_description.expand import expand
from robot_description.mujoco_model import to_mujoco
from robot_description.robots import description_path
from robot_description.urdf import parse_urdf
from robot_description.urdf import Robot

from mujoco_sim.scene import furnish
from mujoco_sim.world import World


class LoadedRobot(NamedTuple):
    """A robot's description: its URDF text and what it says."""

    urdf: str
    robot: Robot


def load_robot(name_or_path: str, search: Sequence[Path] = ()) -> LoadedRobot:
    """
    Expand and parse a description.

    Raises:
        DescriptionError: what is wrong with it, in one line.
    """
    urdf = expand(description_path(name_or_path), search=search)
    return LoadedRobot(urdf, parse_urdf(urdf))


def build_world(loaded: LoadedRobot, world: str = 'flat', seed: int = 0) -> World:
    """
    Put a robot into a world.

    Raises:
        DescriptionError: MuJoCo cannot read the robot.
        SimulationError: there is no such world, or the two do not compile.
    """
    spec = to_mujoco(loaded.urdf, loaded.robot)
    furnish(spec, world)
    return World(spec, loaded.robot.root, seed)
