# SPDX-License-Identifier: Apache-2.0
"""A description from its file to its content and its meshes, in one step."""

from collections.abc import Mapping, Sequence
import logging
from pathlib import Path
from typing import Any, NamedTuple

from wasd_core.errors import DescriptionError

from robot_description.drive_wheels import equipped
from robot_description.expand import expand_document
from robot_description.inertia import impossible_inertias
from robot_description.mesh_report import MeshReport
from robot_description.mesh_resolver import resolve_meshes
from robot_description.robots import description_path
from robot_description.stand_in_masses import with_stand_in_masses
from robot_description.urdf import parse_urdf
from robot_description.urdf import Robot

# Without a handler Python writes warnings to standard error, a line each.
LOGGER = logging.getLogger(__name__)


class Description(NamedTuple):
    """
    A robot's description: its file, URDF text and content, and what became of its meshes.

    `warnings` are what xacro was not happy with, an argument that the file does not have, say.
    """

    path: Path
    urdf: str
    robot: Robot
    meshes: MeshReport
    warnings: tuple[str, ...] = ()

    @property
    def repairs(self) -> tuple[str, ...]:
        """What is not as the description says, in one line each."""
        lines = [record.line() for record in self.meshes.repairs]
        return (*lines, *impossible_inertias(self.robot))

    def with_stand_in_masses(self) -> 'Description':
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


def read_description(
    path: Path, search: Sequence[Path] = (), arguments: Mapping[str, str] | None = None
) -> Description:
    """
    Expand and parse a xacro or URDF file and find its meshes.

    `search` are folders in which packages are looked for first, `arguments` are xacro arguments.

    Raises:
        DescriptionError: what is wrong with it, in one line.
    """
    expansion = expand_document(path, arguments, search)
    warnings = tuple(f'{place or path}: {text}' for place, text in expansion.warnings)
    return parse_description(expansion.urdf, path, search)._replace(warnings=warnings)


def parse_description(urdf: str, path: Path, search: Sequence[Path] = ()) -> Description:
    """
    Parse the URDF text of a file and find its meshes, by names relative to the file, too.

    Raises:
        DescriptionError: what is wrong with it, in one line.
    """
    try:
        robot = parse_urdf(urdf)
        return Description(path, urdf, robot, resolve_meshes(robot, path, search))
    except DescriptionError as error:
        raise DescriptionError(f'{path}: {error}') from None


def load_robot(
    name_or_path: str,
    search: Sequence[Path] = (),
    arguments: Mapping[str, str] | None = None,
    strict: bool = False,
    urdf: str | None = None,
) -> Description:
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
