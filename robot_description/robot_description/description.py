# SPDX-License-Identifier: Apache-2.0
"""A description from its file to its content and its meshes, in one step."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
import logging
from pathlib import Path
from typing import Any

from wasd_core.errors import DescriptionError

from robot_description.meshes.opening import open_meshes, with_stand_ins
from robot_description.meshes.resolver import MeshReport, MeshResolver
from robot_description.morphology.equip_wheels import equip_drive, hanging
from robot_description.morphology.kinds import Kind, name_kind
from robot_description.morphology.quadruped import (
    equip_legs,
    find_quadruped,
    NotAQuadruped,
    Quadruped,
)
from robot_description.morphology.wheels import ANY_WHEELS, Drive, find_drive, WheelChoice
from robot_description.packages import description_path
from robot_description.robot import absurd_size, credible_inertias, impossible_inertias, Robot
from robot_description.urdf import parse_urdf
from robot_description.xacro.session import expand_document

# Without a handler Python writes warnings to standard error, a line each.
LOGGER = logging.getLogger(__name__)

# Kinds of robots.
QUADRUPED = 'quadruped'
DIFF_DRIVE = 'diff-drive'
OTHER = 'other'


@dataclass(frozen=True)
class Description:
    """
    A robot's description: its file, URDF text and content, and its meshes.

    What loads, simulates or drives a robot takes this, so that a file is read and parsed once.
    `robot` is `urdf` parsed, with motors and tyres where `load_robot` filled gaps.
    `warnings` are what xacro was not happy with, an argument that the file does not have, say, and
    inertias that no body of the robot's size has, which are replaced.
    `wheels` is what somebody says of the driven ones.
    """

    path: Path
    urdf: str
    robot: Robot
    meshes: MeshReport
    warnings: tuple[str, ...] = ()
    wheels: WheelChoice = ANY_WHEELS

    @property
    def quadruped(self) -> Quadruped:
        """
        The robot's four legs, which are looked for once.

        Raises:
            NotAQuadruped: what was found instead.
        """
        if isinstance(self._quadruped, NotAQuadruped):
            what, cure = self.nature
            instead = f'; {self.robot.name!r} is {what}: {cure}' if what else ''
            # A new one: what is raised holds on to its callers, and this is kept.
            raise NotAQuadruped(f'{self._quadruped}{instead}', self._quadruped.limbs)
        return self._quadruped

    @property
    def why_no_quadruped(self) -> NotAQuadruped | None:
        """Why the robot has not four legs to walk on, or None of one that has."""
        return self._quadruped if isinstance(self._quadruped, NotAQuadruped) else None

    @cached_property
    def _quadruped(self) -> Quadruped | NotAQuadruped:
        try:
            return find_quadruped(self.robot)
        except NotAQuadruped as error:
            return error.with_traceback(None)

    @property
    def kind(self) -> str:
        """`quadruped`, `diff-drive` for two driven wheels on one axle, or `other`."""
        if isinstance(self._quadruped, Quadruped):
            return QUADRUPED
        return DIFF_DRIVE if self.drive.wheels else OTHER

    @cached_property
    def nature(self) -> Kind:
        """What the robot is in words, and what to do with it."""
        return name_kind(self.robot, self.drive)

    @cached_property
    def drive(self) -> Drive:
        """The robot's two driven wheels, or why it has none."""
        return find_drive(self.robot, self.wheels)

    @property
    def repairs(self) -> tuple[str, ...]:
        """What is not as the description says, in one line each."""
        lines = [record.line() for record in self.meshes.repairs]
        return (*lines, *impossible_inertias(self.robot))

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
    parsed = parse_description(expansion.urdf, path, search)
    return replace(parsed, warnings=(*warnings, *parsed.warnings)) if warnings else parsed


def parse_description(urdf: str, path: Path, search: Sequence[Path] = ()) -> Description:
    """
    Parse the URDF text of a file and find its meshes, by names relative to the file, too.

    Raises:
        DescriptionError: what is wrong with it, in one line.
    """
    try:
        robot, lines = credible_inertias(parse_urdf(urdf))
        meshes = open_meshes(robot, MeshResolver(robot, path, search).report())
        robot = with_stand_ins(replace(robot, mesh_files=meshes.files), meshes.is_usable)
        return Description(path, urdf, robot, meshes, (*robot.notes, *lines, *absurd_size(robot)))
    except DescriptionError as error:
        raise DescriptionError(f'{path}: {error}') from None


def equip(loaded: Description) -> tuple[Description, tuple[str, ...]]:
    """Return a description whose robot can be driven, and lines on what that took."""
    robot, line = loaded.robot, ''
    if isinstance(loaded._quadruped, Quadruped):
        robot, line = equip_legs(robot, loaded._quadruped)
    robot = equip_drive(robot, loaded.drive)
    lines = (line,) if line else (*loaded.drive.notes, *hanging(robot, loaded.drive))
    return loaded if robot is loaded.robot else replace(loaded, robot=robot), lines


def load_robot(
    name_or_path: str,
    search: Sequence[Path] = (),
    arguments: Mapping[str, str] | None = None,
    strict: bool = False,
    urdf: str | None = None,
    wheels: WheelChoice = ANY_WHEELS,
) -> Description:
    """
    Expand and parse a description, find and open its meshes; none of them stops anything.

    `search` are folders in which packages are looked for first, `arguments` are xacro arguments;
    with `strict` every mesh has to be sound and where the description says; else repairs are
    logged. A `urdf` text is taken in place of the file, which may have gone. Driven wheels are
    those of `wheels`, where these are named.

    Raises:
        DescriptionError: what is wrong with it, in one line.
    """
    if urdf is not None:
        loaded = parse_description(urdf, Path(name_or_path), search)
    else:
        loaded = read_description(description_path(name_or_path), search, arguments)
    if strict and (lines := loaded.meshes.repairs):
        more = f' (and {len(lines) - 1} more)' if len(lines) > 1 else ''
        raise DescriptionError(f'{loaded.path}: --strict: {lines[0].line()}{more}')
    if wheels is not ANY_WHEELS:
        loaded = replace(loaded, wheels=wheels)
    equipped, notes = equip(loaded)
    for line in (*loaded.warnings, *loaded.repairs, *notes):
        LOGGER.warning('description: %s', line)
    return equipped
