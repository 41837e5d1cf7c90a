# SPDX-License-Identifier: Apache-2.0
"""The output of `describe info`: tree, masses, joints, meshes, agreement of libraries."""

from collections.abc import Callable, Iterable, Iterator, Mapping
import io
import logging
import math
import sys
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.tree import Tree
from wasd_core.extras import import_extra
from wasd_core.streams import unguarded, visible

from robot_description.description import Description, DIFF_DRIVE, OTHER, QUADRUPED
from robot_description.meshes.resolver import MeshRecord
from robot_description.morphology.quadruped import Quadruped
from robot_description.morphology.wheels import Drive
from robot_description.robot import Joint, Robot
from robot_description.urdf import parse_urdf

# Where no terminal says how wide it is.
WIDTH = 120
Positions = Mapping[str, float]
Places = dict[str, np.ndarray]
LinkPlaces = Callable[[Positions], Places]
# Joints without limits are tried so far to both sides [rad], sliding ones so far [m].
FULL_TURN = math.pi
PLACES = ('front left', 'front right', 'rear left', 'rear right')
SLIDE = 0.5


def info_record(description: Description) -> dict[str, Any]:
    """Return all there is to know in SI units, with `null` for a limit that there is not."""
    robot = description.robot
    return {
        'path': str(description.path),
        'name': robot.name,
        'kind': description.kind,
        'what': description.nature.what,
        'root': robot.root,
        'floating': not robot.is_fixed,
        'mass': robot.mass,
        'wheels': _wheels_record(description.drive),
        'legs': _legs_record(description),
        'links': [
            {
                'name': link.name,
                'mass': link.mass,
                'visuals': [shape.url or shape.kind for shape in link.visuals],
                'collisions': [shape.url or shape.kind for shape in link.collisions],
            }
            for link in robot.links.values()
        ],
        'joints': [_joint_record(joint) for joint in robot.joints.values()],
        'meshes': [record.record() for record in description.meshes.records],
        'repairs': list(description.repairs),
        'warnings': list(description.warnings),
    }


def _wheels_record(drive: Drive) -> dict[str, Any]:
    """Return the driven wheels, left first, and their track, or why there are none."""
    if not drive.wheels:
        return {'why_not': drive.why_not()}
    return {
        'joints': [wheel.joint.name for wheel in drive.wheels],
        'radii': [wheel.radius for wheel in drive.wheels],
        'track': drive.track,
        'notes': list(drive.notes),
    }


def _legs_record(description: Description) -> dict[str, Any]:
    """Return the four legs and what is held, or why there are no such legs."""
    why_not = description.why_no_quadruped
    if why_not is not None:
        return {'why_not': str(why_not), 'limbs': why_not.limbs}
    quadruped = description.quadruped
    return {
        'legs': [
            {
                'joints': [joint.name for joint in leg.joints],
                'foot': leg.foot,
                'foot_radius': leg.foot_radius,
                'thigh': leg.thigh,
                'calf': leg.calf,
            }
            for leg in quadruped.legs
        ],
        'held': dict(quadruped.held),
        'limbs': dict(quadruped.passed),
    }


def _joint_record(joint: Joint) -> dict[str, Any]:
    return {
        'name': joint.name,
        'type': joint.kind,
        'parent': joint.parent,
        'child': joint.child,
        'axis': joint.axis.tolist(),
        'lower': joint.lower if math.isfinite(joint.lower) else None,
        'upper': joint.upper if math.isfinite(joint.upper) else None,
        'effort': joint.effort if joint.has_effort else None,
        'velocity': joint.velocity if joint.has_velocity else None,
        'mimics': joint.mimics or None,
    }


def print_info(info: Description) -> None:
    """Print the robot's tree, its joints and its meshes."""
    robot = info.robot
    root = _shown(robot.root)
    base = f'hangs on {root}' if robot.is_fixed else f'floats, root {root}'
    movable = len(robot.movable_joints)
    with unguarded(sys.stdout) as file:
        console = Console(file=file, highlight=False)
        if not console.is_terminal:
            console.width = WIDTH
        console.print(
            f'[bold]{_shown(robot.name)}[/]  {info.kind}, {_kilograms(robot.mass)} kg, {base}; '
            f'{len(robot.links)} links, {len(robot.joints)} joints, {movable} of them movable'
        )
        if info.kind == QUADRUPED:
            console.print(_legs(info.quadruped))
        for line in _why(info):
            console.print(_shown(line), soft_wrap=True)
        console.print(_tree(robot))
        if movable:
            console.print(_joints(robot.movable_joints))
        if info.meshes.records:
            console.print(_meshes(info.meshes.records))
        for line in (*info.warnings, *info.repairs):
            console.print(_shown(line), soft_wrap=True)


def _why(info: Description) -> Iterator[str]:
    """Yield why a robot is of its kind."""
    drive = info.drive
    if info.kind == QUADRUPED:
        held = info.quadruped.held
        if held:
            yield f'held where it is: {", ".join(f"{name} {at:.4g}" for name, at in held.items())}'
        yield from _no_legs(info.quadruped.passed)
    elif info.kind == DIFF_DRIVE:
        wheels = ', '.join(f'{wheel.joint.name} {wheel.radius:g} m' for wheel in drive.wheels)
        yield f'driven wheels (left, right): {wheels}; track {drive.track:g} m'
        yield from drive.notes
    elif info.kind == OTHER:
        if info.nature.what:
            yield f'it is {info.nature.what}; {info.nature.cure}'
        yield f'no wheels to drive: it {drive.why_not()}'
        if info.why_no_quadruped is not None:
            yield f'no legs to walk on: {info.why_no_quadruped}'
            yield from _no_legs(info.why_no_quadruped.limbs)


def _no_legs(limbs: Mapping[str, str]) -> Iterator[str]:
    """Yield why limbs are no legs, those with one reason in one line."""
    for reason in dict.fromkeys(why for why in limbs.values() if why):
        names = ', '.join(name for name, why in limbs.items() if why == reason)
        yield f'no leg: {names}: {reason}'


def _legs(quadruped: Quadruped) -> Table:
    """Return the legs in the order in which the controller has them."""
    table = Table('leg', 'hip', 'thigh', 'calf', 'lengths', 'foot', 'radius', 'knee', box=None)
    for place, leg in zip(PLACES, quadruped.legs, strict=True):
        table.add_row(
            place,
            *(_shown(joint.name) for joint in leg.joints),
            f'{leg.thigh:.3g} + {leg.calf:.3g} m',
            _shown(leg.foot),
            f'{leg.foot_radius:.3g} m',
            'backward' if leg.bend > 0.0 else 'forward',
        )
    return table


def _kilograms(mass: float) -> str:
    """Return a mass to the gram; one of a thousand tons or more, a mistake, in few digits."""
    return f'{mass:.3f}' if mass < 1e6 else f'{mass:.4g}'


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
            f'{joint.effort:g} {force}' if joint.has_effort else '-',
            f'{joint.velocity:g} {unit}/s' if joint.has_velocity else '-',
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


class Deviation(NamedTuple):
    """How far a library's links are at most from where the URDF's own arithmetic has them [m]."""

    library: str
    distance: float
    link: str


def check_kinematics(description: Description) -> tuple[Deviation, ...]:
    """
    Compare the places of all links in five random poses within the joint limits.

    Mimicking joints are moved like others, each by itself.

    Raises:
        DescriptionError: a library cannot read the robot.
        UserError: one of them is not installed.
    """
    from robot_description.pinocchio_model import bare_urdf

    random = np.random.default_rng(0)
    robot, text = description.robot, bare_urdf(description)
    libraries = {
        'MuJoCo': _in_mujoco(text),
        'Pinocchio': _in_pinocchio(description),
        'yourdfpy': _in_yourdfpy(text),
    }
    worst = {name: Deviation(name, 0.0, robot.root) for name in libraries}
    for _ in range(5):
        positions = {joint.name: _any_position(joint, random) for joint in robot.movable_joints}
        expected = robot.link_poses(positions)
        for name, places_of in libraries.items():
            for link, place in places_of(positions).items():
                distance = float(np.linalg.norm(place - expected[link].position))
                if distance > worst[name].distance:
                    worst[name] = Deviation(name, distance, link)
    return tuple(worst.values())


def _any_position(joint: Joint, random: np.random.Generator) -> float:
    reach = SLIDE if joint.kind == 'prismatic' else FULL_TURN
    low, high = max(joint.lower, joint.rest - reach), min(joint.upper, joint.rest + reach)
    return float(random.uniform(low, high))


def _in_mujoco(urdf: str) -> LinkPlaces:
    import mujoco

    from robot_description.mujoco.builder import compile_model, to_mujoco

    # MuJoCo takes nothing that moves without a mass, which is nothing to where it is.
    spec = to_mujoco(parse_urdf(urdf).with_stand_in_masses())
    spec.compiler.fusestatic = False  # every link stays a body
    model = compile_model(spec)
    bodies = [model.body(index).name for index in range(1, model.nbody)]

    def places(positions: Positions) -> Places:
        data = mujoco.MjData(model)
        for name, position in positions.items():
            data.joint(name).qpos[0] = position
        mujoco.mj_kinematics(model, data)
        return {name: data.body(name).xpos.copy() for name in bodies}

    return places


def _in_pinocchio(description: Description) -> LinkPlaces:
    from robot_description import pinocchio_model

    model = pinocchio_model.to_pinocchio(description)

    def places(positions: Positions) -> Places:
        return pinocchio_model.link_positions(
            model, pinocchio_model.configuration(model, positions)
        )

    return places


def _in_yourdfpy(urdf: str) -> LinkPlaces:
    yourdfpy = import_extra('yourdfpy', 'compare', 'describe info --check')
    logging.getLogger('yourdfpy.urdf').setLevel(logging.ERROR)
    model = yourdfpy.URDF.load(io.BytesIO(urdf.encode()), load_meshes=False)

    def places(positions: Positions) -> Places:
        model.update_cfg(dict(positions))
        return {name: model.get_transform(name)[:3, 3] for name in model.link_map}

    return places
