# SPDX-License-Identifier: Apache-2.0
"""What a description says, as a terminal shows it."""

from collections.abc import Iterable
import math
import sys

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.tree import Tree
from wasd_core.streams import unguarded
from wasd_core.streams import visible

from robot_description.description import Description
from robot_description.mesh_report import MeshRecord
from robot_description.urdf import Joint
from robot_description.urdf import Robot

# Where no terminal says how wide it is.
WIDTH = 120


def print_info(info: Description) -> None:
    """Print the robot's tree, its joints and its meshes."""
    with unguarded(sys.stdout) as file:
        console = Console(file=file, highlight=False)
        if not console.is_terminal:
            console = Console(file=file, highlight=False, width=WIDTH)
        _print_info(console, info)


def _print_info(console: Console, info: Description) -> None:
    robot = info.robot
    root = _shown(robot.root)
    base = f'hangs on {root}' if robot.is_fixed else f'floats, root {root}'
    movable = len(robot.movable_joints)
    console.print(
        f'[bold]{_shown(robot.name)}[/]  {info.kind}, {robot.mass:.3f} kg, {base}; '
        f'{len(robot.links)} links, {len(robot.joints)} joints, {movable} of them movable'
    )
    console.print(_tree(robot))
    if movable:
        console.print(_joints(robot.movable_joints))
    if info.meshes.records:
        console.print(_meshes(info.meshes.records))
    for line in (*info.warnings, *info.repairs):
        console.print(_shown(line), soft_wrap=True)


def _shown(text: str) -> str:
    """Return a text of the description as the console shows it."""
    return escape(visible(text))


def _tree(robot: Robot) -> Tree:
    branches = {robot.root: Tree(_link(robot, robot.root))}
    for link in robot.links_from_root[1:]:
        parent = branches[robot.parent_joints[link].parent]
        branches[link] = parent.add(_link(robot, link))
    return branches[robot.root]


def _link(robot: Robot, name: str) -> str:
    mass = robot.links[name].mass
    text = _shown(name) + (f'  {mass:.4g} kg' if mass > 0.0 else '')
    joint = robot.parent_joints.get(name)
    return f'{text}  [dim]{joint.kind} {_shown(joint.name)}[/]' if joint is not None else text


def _joints(joints: Iterable[Joint]) -> Table:
    table = Table('joint', 'type', 'from', 'to', 'effort', 'velocity', box=None)
    for column in table.columns[2:]:
        column.justify = 'right'
    for joint in joints:
        unit, force = ('m', 'N') if joint.kind == 'prismatic' else ('rad', 'N m')
        kind = f'{joint.kind}, mimics {joint.mimics}' if joint.mimics else joint.kind
        table.add_row(
            _shown(joint.name),
            _shown(kind),
            _limit(joint.lower, unit),
            _limit(joint.upper, unit),
            f'{joint.effort:g} {force}',
            f'{joint.velocity:g} {unit}/s',
        )
    return table


def _limit(value: float, unit: str) -> str:
    return f'{value:.4g} {unit}' if math.isfinite(value) else '-'


def _meshes(records: Iterable[MeshRecord]) -> Table:
    """Return each mesh once, with how often it is used."""
    uses: dict[tuple[str, str], list[MeshRecord]] = {}
    for record in records:
        uses.setdefault((record.url, record.use), []).append(record)
    table = Table('mesh', 'use', 'links', 'found', box=None)
    table.columns[0].overflow = table.columns[3].overflow = 'fold'
    for (url, use), same in uses.items():
        table.add_row(_shown(url), use, str(len(same)), same[0].kind)
    return table
