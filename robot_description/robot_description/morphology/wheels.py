# SPDX-License-Identifier: Apache-2.0
"""The two driven wheels of a robot: found, measured, or why there are none."""

from collections.abc import Mapping, Sequence
from itertools import combinations
import math
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from wasd_core.rotations import Pose

from robot_description.morphology.rollers import (
    carries_all,
    find_rollers,
    is_on_leg,
    is_upright,
    joints_above,
    Roller,
    turned_by,
)
from robot_description.morphology.tyre import (
    differ,
    find_tyre,
    imbalance,
    is_unbalanced,
    OFF_AXIS,
    OFF_RADIUS,
    turns_freely,
    Tyre,
)
from robot_description.morphology.vehicles import other_vehicle
from robot_description.robot import Joint, Robot

# Lengths of a description that differ by no more than this are meant to be equal: CAD rounds to
# 1 mm on each side [m].
OFF_AXLE = 0.002
# More joints than these are not listed.
MOST_LISTED = 8


class WheelChoice(NamedTuple):
    """What somebody says of the wheels, left then right: joint names, radius [m]; 0: nothing."""

    names: tuple[str, ...] = ()
    radius: float = 0.0


# Nothing is said: what is found counts.
ANY_WHEELS = WheelChoice()


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
    might turn a driven wheel turns none; `notes` are what is odd about the two. `idle` are the
    joints of further wheels, of which somebody said that these two drive the robot.
    """

    wheels: tuple[DriveWheel, ...] = ()
    what: str = ''
    passed: Mapping[str, str] = MappingProxyType({})
    notes: tuple[str, ...] = ()
    idle: tuple[Joint, ...] = ()

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
    rollers = find_rollers(robot)
    for joint in robot.joints.values():
        if choice.names and joint.name not in choice.names:
            continue
        wheel = _wheel(robot, joint, choice, rollers)
        if isinstance(wheel, DriveWheel):
            found.append(wheel)
        elif wheel:
            passed[joint.name] = wheel
    found.sort(key=lambda wheel: -float(wheel.position[1]))
    what = ''
    idle: tuple[Joint, ...] = ()
    if choice.names:
        pairs = [pair for pair in combinations(found, 2) if _track(*pair) > OFF_AXLE]
        idle = _others(robot, choice.names, rollers)
    else:
        places = [(wheel.joint, wheel.position) for wheel in found]
        what = other_vehicle(robot, places, rollers)
        pairs = [pair for pair in combinations(found, 2) if not _why_no_axle(*pair)]
    largest = max((max(a.radius, b.radius) for a, b in pairs), default=0.0)
    pairs = [pair for pair in pairs if differ(pair[0].radius, largest) <= OFF_RADIUS]
    if len(pairs) == 1 and not what and not choice.names:
        what = _more_alike(robot, pairs[0], rollers)
    if len(pairs) == 1 and not what:
        return Drive(pairs[0], '', passed, _notes(robot, *pairs[0], idle), idle)
    if len(pairs) > 1 and not what:
        alike = dict.fromkeys(wheel.joint.name for pair in pairs for wheel in pair)
        what = f'a skid-steer ({", ".join(alike)} are driven alike)'
    passed |= {wheel.joint.name: _why_alone(wheel, found) for wheel in found}
    return Drive((), what, passed)


def _more_alike(
    robot: Robot, pair: tuple[DriveWheel, DriveWheel], rollers: Sequence[Roller]
) -> str:
    """Return `a skid-steer` where further wheels as large bear both sides, on bogies, say."""
    names = [wheel.joint.name for wheel in pair]
    size = max(wheel.radius for wheel in pair)
    beside = {joint.name for joint in _others(robot, names, rollers)}
    others = [
        roller
        for roller in rollers
        if roller.joint.name in beside
        and roller.is_measured
        and differ(roller.radius, size) <= OFF_RADIUS
    ]
    middle = 0.5 * float(pair[0].position[1] + pair[1].position[1])
    if len({bool(roller.position[1] > middle) for roller in others}) < 2:
        return ''
    alike = ', '.join([*names, *(roller.joint.name for roller in others)])
    return f'a skid-steer ({alike} are driven alike)'


def _others(robot: Robot, names: Sequence[str], rollers: Sequence[Roller]) -> tuple[Joint, ...]:
    """Return what the base rolls on beside the named wheels; casters are no such wheels."""
    return tuple(
        roller.joint
        for roller in rollers
        if roller.joint.name not in names
        and turned_by(roller, robot) is None
        and not is_on_leg(roller, robot)
    )


def looks_along_y(robot: Robot) -> bool:
    """Whether all that a robot rolls on turns about x, two parts of it on one axle."""
    rollers = find_rollers(robot)
    apart = [np.abs(a.position - b.position) for a, b in combinations(rollers, 2)]
    return all(abs(float(roller.axis[0])) > math.cos(OFF_AXIS) for roller in rollers) and any(
        x > OFF_AXLE >= max(y, z) for x, y, z in apart
    )


def _wheel(
    robot: Robot, joint: Joint, choice: WheelChoice, rollers: Sequence[Roller]
) -> DriveWheel | str:
    """Return a joint's wheel, or why it has none; nothing of what nobody would take for one."""
    if not turns_freely(joint):
        if not choice.names:
            return ''
        return f'is {joint.kind}: a wheel turns freely (continuous)'
    frame = robot.zero_poses[joint.child]
    axis = frame.rotation @ joint.axis
    tilt = math.acos(min(1.0, abs(float(axis[1]))))
    most = math.pi / 4 if choice.names else OFF_AXIS
    if tilt > most:
        off, limit = math.degrees(tilt), math.degrees(most)
        return f'has its axis {off:.3g} degrees off y ({limit:g} are taken)'
    if joint.mimics:
        return f'mimics {joint.mimics!r}, a driven wheel has a motor of its own'
    above = joints_above(robot, joint)
    # A waist, with all that the robot rolls on below it, is held as what it carries is.
    mounts = [each for each in above if robot.is_fixed or not carries_all(each, rollers)]
    swivel = next((each for each in mounts if is_upright(robot, each)), None)
    if swivel is not None:
        return f'is on {swivel.name!r}, which swivels about z: a caster'
    if len(mounts) > 1:
        return f'is held by {mounts[0].name!r} and {mounts[1].name!r}, which move (1 is taken)'
    tyre = find_tyre(robot, joint, choice.radius)
    if isinstance(tyre, str):
        return tyre
    names = [each.name for each in mounts]
    larger = (r.joint.name for r in rollers if r.joint.name in names and r.radius > tyre.radius)
    if hub := next(larger, ''):
        return f'is a gear on {hub!r}, which turns something larger'
    position = (frame @ Pose(tyre.centre, np.eye(3))).position
    return DriveWheel(joint, position, tyre.radius, 1 if axis[1] > 0.0 else -1, tyre, above)


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
    if differ(a.radius, b.radius) > OFF_RADIUS:
        share = 100.0 * differ(a.radius, b.radius)
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


def _notes(robot: Robot, a: DriveWheel, b: DriveWheel, idle: Sequence[Joint]) -> tuple[str, ...]:
    """Return what is odd about two wheels, and what becomes of those beside them."""
    notes = []
    if idle:
        names = ', '.join(joint.name for joint in idle)
        notes.append(f'{names}: not driven, so these wheels slide as casters without friction do')
    if not math.isclose(a.radius, b.radius, rel_tol=1e-6):
        notes.append(
            f'wheel radii differ: {a.joint.name} {a.radius:g} m, {b.joint.name} {b.radius:g} m: '
            'each wheel is driven by its own'
        )
    if max(map(abs, _off(a, b))) > OFF_AXLE:
        notes.append(f'{a.joint.name} {_why_no_axle(a, b)}: driven as if it were on it')
    for wheel in (a, b):
        if is_unbalanced(robot, wheel.joint, wheel.radius):
            off = imbalance(robot, wheel.joint)
            notes.append(f'the centre of mass of {wheel.joint.child} is {off:.3g} m off its axle')
    mounts = {mount.name: mount for wheel in (a, b) for mount in wheel.mounts}
    for name, mount in mounts.items():
        on = [wheel.joint.name for wheel in (a, b) if mount in wheel.mounts]
        at = f'held at {mount.rest:g} {"m" if mount.kind == "prismatic" else "rad"}'
        what = 'both wheels' if len(on) > 1 else f'the wheel {on[0]}'
        spring = '' if len(on) > 1 else ', its spring is not simulated'
        notes.append(f'{name} carries {what}: {at}{spring}')
    return tuple(notes)
