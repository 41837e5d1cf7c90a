# SPDX-License-Identifier: Apache-2.0
"""What a description says, in short: its tree, masses and joints."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from dataclasses import dataclass
from pathlib import Path

from robot_description.expand import expand
from robot_description.urdf import parse_urdf
from robot_description.urdf import Robot


@dataclass(frozen=True)
class Info:
    """A robot in short; `mass` is the sum over its links [kg]."""

    name: str
    root: str
    mass: float
    links: tuple[str, ...]
    joints: tuple[str, ...]
    movable_joints: tuple[str, ...]

    def lines(self) -> list[str]:
        """Return it as text for a terminal."""
        return [
            f'robot   {self.name}',
            f'mass    {self.mass:.3f} kg',
            f'links   {len(self.links)}, root {self.root}',
            f'joints  {len(self.joints)}, movable: {", ".join(self.movable_joints) or "none"}',
        ]

    def record(self) -> dict[str, object]:
        """Return it as JSON has it."""
        return asdict(self)


def describe_info(
    path: Path,
    arguments: Mapping[str, str],
    search: Sequence[Path] = (),
    picture: Path | None = None,
) -> Info:
    """
    Return what a xacro or URDF file says; `arguments` are xacro args.

    Raises:
        DescriptionError: what is wrong with it, in one line.
    """
    return _summary(parse_urdf(expand(path, arguments, search)))


def _summary(robot: Robot) -> Info:
    return Info(
        name=robot.name,
        root=robot.root,
        mass=robot.mass,
        links=tuple(robot.links),
        joints=tuple(robot.joints),
        movable_joints=tuple(joint.name for joint in robot.movable_joints),
    )
