# SPDX-License-Identifier: Apache-2.0
"""The two driven wheels of a robot: found, measured, or why there are none."""

from collections.abc import Mapping, Sequence
from itertools import combinations
import math
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from wasd_core.rotations import IDENTITY
from wasd_core.rotations import Pose

from robot_description.meshes.load import mesh_points
from robot_description.morphology.vehicles import is_upright
from robot_description.morphology.vehicles import other_vehicle
from robot_description.robot import Joint
from robot_description.robot import Link
from robot_description.robot import Robot
from robot_description.robot import Shape

# Lengths and angles of a description that differ by no more than this are meant to be equal:
# CAD rounds to 1 mm and 0.5 degrees on each side, exporters write 1.57 for a right angle.
OFF_AXLE = 0.002  # [m]
OFF_AXIS = math.radians(1.0)  # [rad]
# Wheels of a pair differ by no more than this share of the larger radius; nor is a mesh rounder.
OFF_RADIUS = 0.1
# A wheel turns freely, or by more than this [rad]: some exporters know no continuous joint.
FULL_TURN = 2.0 * math.pi
# So exactly along the joint's axis a cylinder needs no other in its place.
EXACT = 1.0 - 1e-6
# More joints than these are not listed.
MOST_LISTED = 8
# Directions about a wheel's axis in which its mesh is measured.
DIRECTIONS = 16
# A wheel whose shapes say no width [m].
USUAL_WIDTH = 0.02


class WheelChoice(NamedTuple):
    """What somebody says of the wheels, left then right: joint names, radius [m]; 0: nothing."""

    names: tuple[str, ...] = ()
    radius: float = 0.0


# Nothing is said: what is found counts.
ANY_WHEELS = WheelChoice()


class Tyre(NamedTuple):
    """What rolls: middle (3,) in the link [m], radius and width [m]; as it is, or to be put in."""

    centre: np.ndarray
    radius: float
    width: float
    is_exact: bool


class DriveWheel(NamedTuple):
    """A wheel: joint, centre in the root [m], radius [m], sign of its axis along y, its tyre."""

    joint: Joint
    position: np.ndarray
    radius: float
    direction: int
    tyre: Tyre
    mounts: tuple[Joint, ...] = ()


class Drive(NamedTuple):
    """
    What was found: two wheels, left first, or none.

    `what` is the vehicle that it is instead, where that can be told, `passed` why each joint that
    might turn a driven wheel turns none; `notes` are what is odd about the two.
    """

    wheels: tuple[DriveWheel, ...] = ()
    what: str = ''
    passed: Mapping[str, str] = MappingProxyType({})
    notes: tuple[str, ...] = ()

    @property
    def track(self) -> float:
        """Distance between the two wheels [m]."""
        left, right = self.wheels
        return float(left.position[1] - right.position[1])

    @property
    def weakest(self) -> DriveWheel:
        """The wheel whose motor has the least torque to spare over its joint's dry friction."""
        return min(self.wheels, key=lambda wheel: wheel.joint.effort - wheel.joint.friction)

    @property
    def speed_limit(self) -> float:
        """What the slower of the two wheels can do [rad/s]; infinite where nothing limits it."""
        speeds = [wheel.joint.velocity for wheel in self.wheels if wheel.joint.velocity > 0.0]
        return min(speeds, default=math.inf)

    def why_not(self) -> str:
        """Return why there are no two wheels, in words that go on from the robot's name."""
        if self.what:
            return f'is {self.what}; only two driven wheels are simulated'
        listed = [f'{joint} {why}' for joint, why in self.passed.items()]
        if len(listed) > MOST_LISTED:
            listed = [*listed[:MOST_LISTED], f'and {len(listed) - MOST_LISTED} more']
        found = '; '.join(listed) or 'none of its joints turns freely (continuous)'
        return f'has no two driven wheels on one axle: {found}'


def find_drive(robot: Robot, choice: WheelChoice = ANY_WHEELS) -> Drive:
    """
    Return the driven wheels of a robot.

    They are round, turn about y on joints that go round, are held by the base, at most on one
    spring or slide each, and sit beside each other on one axle. Of several pairs the larger one
    drives: casters are smaller. A choice decides: only its joints are looked at, wherever they
    are, and its radius is that of what has none.
    """
    found: list[DriveWheel] = []
    passed: dict[str, str] = {}
    for joint in robot.joints.values():
        if choice.names and joint.name not in choice.names:
            continue
        wheel = _wheel(robot, joint, choice)
        if isinstance(wheel, DriveWheel):
            found.append(wheel)
        elif wheel:
            passed[joint.name] = wheel
    found.sort(key=lambda wheel: -float(wheel.position[1]))
    what = ''
    if choice.names:
        pairs = [pair for pair in combinations(found, 2) if _track(*pair) > OFF_AXLE]
    else:
        what = other_vehicle(robot, [(wheel.joint, wheel.position) for wheel in found])
        pairs = [pair for pair in combinations(found, 2) if not _why_no_axle(*pair)]
    largest = max((max(a.radius, b.radius) for a, b in pairs), default=0.0)
    pairs = [pair for pair in pairs if _differ(pair[0].radius, largest) <= OFF_RADIUS]
    if len(pairs) == 1 and not what:
        return Drive(pairs[0], '', passed, _notes(*pairs[0]))
    if len(pairs) > 1 and not what:
        alike = dict.fromkeys(wheel.joint.name for pair in pairs for wheel in pair)
        what = f'a skid-steer ({", ".join(alike)} are driven alike)'
    passed |= {wheel.joint.name: _why_alone(wheel, found) for wheel in found}
    return Drive((), what, passed)


def drive_wheels(robot: Robot) -> tuple[DriveWheel, ...]:
    """Return the driven wheels, left first; none where the robot has no such pair."""
    return find_drive(robot).wheels


def _wheel(robot: Robot, joint: Joint, choice: WheelChoice) -> DriveWheel | str:
    """Return a joint's wheel, or why it has none; nothing of what nobody would take for one."""
    turns = joint.kind == 'continuous' or (
        joint.kind == 'revolute' and joint.upper - joint.lower >= FULL_TURN
    )
    if not turns:
        if not choice.names:
            return ''
        return f'is {joint.kind}: a wheel turns freely (continuous)'
    frame = robot.rest_poses[joint.child]
    axis = frame.rotation @ joint.axis
    tilt = math.acos(min(1.0, abs(float(axis[1]))))
    if tilt > (math.pi / 4 if choice.names else OFF_AXIS):
        limit = math.degrees(OFF_AXIS)
        return f'has its axis {math.degrees(tilt):.3g} degrees off y ({limit:g} are taken)'
    if joint.mimics:
        return f'mimics {joint.mimics!r}, a driven wheel has a motor of its own'
    mounts = _moving_above(robot, joint)
    swivel = next((each for each in mounts if is_upright(robot, each)), None)
    if swivel is not None:
        return f'is on {swivel.name!r}, which swivels about z: a caster'
    if len(mounts) > 1:
        return f'is held by {mounts[0].name!r} and {mounts[1].name!r}, which move (1 is taken)'
    tyre = _tyre(robot, joint, choice.radius)
    if isinstance(tyre, str):
        return tyre
    position = (frame @ Pose(tyre.centre, np.eye(3))).position
    return DriveWheel(joint, position, tyre.radius, 1 if axis[1] > 0.0 else -1, tyre, mounts)


def _moving_above(robot: Robot, joint: Joint) -> tuple[Joint, ...]:
    """Return the first two joints that are not fixed on the way from a joint to the root."""
    found: list[Joint] = []
    above = robot.parent_joints.get(joint.parent)
    while above is not None and len(found) < 2:
        if above.kind != 'fixed':
            found.append(above)
        above = robot.parent_joints.get(above.parent)
    return tuple(found)


def _tyre(robot: Robot, joint: Joint, radius: float) -> Tyre | str:
    """Return what of a joint's links is round about its axis, or why nothing is."""
    why = 'has no shape'
    for link, pose in carried(robot, joint.child):
        for shape in (*link.collisions, *link.visuals):
            tyre = _measure(robot, joint.axis, shape, pose @ shape.pose)
            if isinstance(tyre, Tyre) and tyre.radius <= 0.0:
                why = f'has a {shape.kind} without a radius'
            elif isinstance(tyre, Tyre):
                own = link.name == joint.child and shape.collides
                return tyre._replace(is_exact=tyre.is_exact and own)
            else:
                why = tyre
    return Tyre(np.zeros(3), radius, USUAL_WIDTH, is_exact=False) if radius else why


def carried(robot: Robot, link: str) -> list[tuple[Link, Pose]]:
    """Return a link and those welded to it, with their poses in it."""
    found = [(robot.links[link], IDENTITY)]
    for above, pose in found:  # which grows meanwhile
        found += [
            (robot.links[joint.child], pose @ joint.pose)
            for joint in robot.joints.values()
            if joint.kind == 'fixed' and joint.parent == above.name
        ]
    return found


def _measure(robot: Robot, axis: np.ndarray, shape: Shape, pose: Pose) -> Tyre | str:
    """Return a shape at a pose in the wheel's link as a tyre about an axis, or why it is none."""
    if shape.kind == 'sphere':
        return Tyre(pose.position, shape.size[0], USUAL_WIDTH, is_exact=True)
    if shape.kind in ('cylinder', 'capsule'):
        radius, length = shape.size
        along = abs(float(pose.rotation[:, 2] @ axis))
        tilt = math.acos(min(1.0, along))
        if tilt > OFF_AXIS:
            return (
                f'has a {shape.kind} that lies {math.degrees(tilt):.3g} degrees off its axis '
                f'({math.degrees(OFF_AXIS):g} are taken)'
            )
        return Tyre(pose.position, radius, length, shape.kind == 'cylinder' and along > EXACT)
    points = mesh_points(robot, shape) if shape.kind == 'mesh' else None
    if points is None:
        what = f'mesh that is not to be had ({shape.url})' if shape.url else shape.kind
        return f'has a {what}, nothing round; wheel_radius would say'
    return _measure_points(axis, points @ pose.rotation.T + pose.position)


def _measure_points(axis: np.ndarray, points: np.ndarray) -> Tyre | str:
    """Return the tyre that points (n, 3) in the wheel's link are, if they are round."""
    side = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    side /= np.linalg.norm(side)
    angles = np.arange(DIRECTIONS) * 2.0 * np.pi / DIRECTIONS
    ways = np.outer(np.cos(angles), side) + np.outer(np.sin(angles), np.cross(axis, side))
    reaches = (points @ ways.T).max(axis=0)
    shortest, longest = float(reaches.min()), float(reaches.max())
    if _differ(shortest, longest) > OFF_RADIUS:
        return (
            f'has a mesh that reaches from {shortest:.3g} to {longest:.3g} m from the axis '
            f'({100 * OFF_RADIUS:g} % are round)'
        )
    along = points @ axis
    middle = 0.5 * float(along.min() + along.max())
    return Tyre(middle * axis, longest, float(np.ptp(along)), is_exact=False)


def _differ(one: float, other: float) -> float:
    """Return by which share of the larger one two lengths differ."""
    return abs(one - other) / max(one, other, 1e-12)


def _track(a: DriveWheel, b: DriveWheel) -> float:
    return abs(float(a.position[1] - b.position[1]))


def _why_no_axle(a: DriveWheel, b: DriveWheel) -> str:
    """Return why two wheels are no pair; nothing where they sit beside each other."""
    x, y, z = np.abs(a.position - b.position).tolist()
    limit = f'({1e3 * OFF_AXLE:g} mm are taken)'
    if x > OFF_AXLE or z > OFF_AXLE:
        return f'is {1e3 * max(x, z):.3g} mm off the axle of {b.joint.name} {limit}'
    if y <= OFF_AXLE:
        return f'is where {b.joint.name} is'
    if _differ(a.radius, b.radius) > OFF_RADIUS:
        share = 100.0 * _differ(a.radius, b.radius)
        return (
            f'has a radius of {a.radius:g} m, {b.joint.name} one of {b.radius:g} m, '
            f'{share:.3g} % apart ({100 * OFF_RADIUS:g} % are taken)'
        )
    return ''


def _why_alone(wheel: DriveWheel, found: Sequence[DriveWheel]) -> str:
    others = [other for other in found if other is not wheel]
    if not others:
        return 'is alone: no second wheel beside it'
    nearest = min(others, key=lambda other: float(np.hypot(*_off(wheel, other))))
    return _why_no_axle(wheel, nearest)


def _off(a: DriveWheel, b: DriveWheel) -> tuple[float, float]:
    x, _, z = (a.position - b.position).tolist()
    return x, z


def _notes(a: DriveWheel, b: DriveWheel) -> tuple[str, ...]:
    """Return what is odd about two wheels."""
    notes = []
    if not math.isclose(a.radius, b.radius, rel_tol=1e-6):
        notes.append(
            f'wheel radii differ: {a.joint.name} {a.radius:g} m, {b.joint.name} {b.radius:g} m: '
            'each wheel is driven by its own'
        )
    if max(map(abs, _off(a, b))) > OFF_AXLE:
        notes.append(f'{a.joint.name} {_why_no_axle(a, b)}: driven as if it were on it')
    for wheel in (a, b):
        for mount in wheel.mounts:
            unit = 'm' if mount.kind == 'prismatic' else 'rad'
            notes.append(
                f'{mount.name} carries the wheel {wheel.joint.name}: held at '
                f'{mount.rest:g} {unit}, its spring is not simulated'
            )
    return tuple(notes)
