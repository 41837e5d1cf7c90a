# SPDX-License-Identifier: Apache-2.0
"""A description from its file to its content and its meshes, in one step."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from robot_description.errors import DescriptionError
from robot_description.expand import expand_document
from robot_description.inertia import impossible_inertias
from robot_description.mesh_report import MeshReport
from robot_description.mesh_resolver import resolve_meshes
from robot_description.stand_in_masses import with_stand_in_masses
from robot_description.urdf import parse_urdf
from robot_description.urdf import Robot


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
