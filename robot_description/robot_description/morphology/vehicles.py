# SPDX-License-Identifier: Apache-2.0
"""What else drives on wheels, by its shape, and by its names where shape says nothing."""

from collections.abc import Sequence
import math
from pathlib import PurePosixPath

import numpy as np

from robot_description.morphology.names import words
from robot_description.morphology.rollers import (
    CASTER_WORDS,
    is_on_leg,
    Roller,
    steered_by,
    turned_by,
)
from robot_description.robot import Joint, Robot

# Axes of wheels that stand in each other's way by more than this [rad] are those of an omni base.
CROSSED = math.radians(15.0)
# Wheels that bear a robot alike differ by no more than this share of the largest radius.
ALIKE = 0.3
WHEEL_WORDS = {'wheel', 'wheels', 'tire', 'tyre', 'tires', 'tyres'}
ROLLER_WORDS = {'mecanum', 'omni', 'omniwheel', 'swedish', 'roller', 'rollers'}
TRACK_WORDS = {'track', 'tracks', 'crawler', 'crawlers', 'caterpillar'}
# A vehicle with so many wheels on a side has them in tracks; a name says so of so many parts.
TRACK_WHEELS = 4
FEWEST_ROLLERS, FEWEST_TRACKS = 3, 2
# So many wheels that all swivel are steered: casters bear what others drive.
FEWEST_SWIVELS = 3
# A wheel of fewer small ones on its rim has decoration.
FEWEST_BEADS = 4

Place = tuple[Joint, np.ndarray]


def other_vehicle(robot: Robot, wheels: Sequence[Place], rollers: Sequence[Roller]) -> str:
    """
    Return what a robot is that two driven wheels do not make, in words after `is`; else nothing.

    `wheels` are the joints of those that the base holds, with the wheels' places in the root [m];
    `rollers` are all that it rolls on.
    """
    steered = _steered(robot, rollers)
    if steered:
        return steered
    rim = _rolling_rim(rollers) or _crossed(rollers)
    if rim:
        return f'a mecanum or omni base ({rim})'
    named = _named(robot, ROLLER_WORDS, WHEEL_WORDS) or _slanted(robot, rollers)
    if len(named) >= FEWEST_ROLLERS:
        return f'a mecanum or omni base ({", ".join(named)})'
    tracks = _named(robot, TRACK_WORDS, TRACK_WORDS)
    if len(tracks) >= FEWEST_TRACKS:
        return f'a tracked vehicle ({", ".join(tracks)})'
    left = sum(place[1] > 0.0 for _, place in wheels)
    return f'a tracked vehicle ({left} wheels on the left)' if left >= TRACK_WHEELS else ''


def _steered(robot: Robot, rollers: Sequence[Roller]) -> str:
    """Return what a robot is that steers wheels: one of them, some, or all; else nothing."""
    rollers = [roller for roller in rollers if not is_on_leg(roller, robot)]
    by = {each.joint.name: steered_by(each, rollers, robot) for each in rollers}
    steering = list(dict.fromkeys(joint.name for joint in by.values() if joint is not None))
    held = [each for each in rollers if turned_by(each, robot) is None]
    if len(rollers) >= FEWEST_SWIVELS and not held:
        turned = [turned_by(each, robot) for each in rollers]
        names = dict.fromkeys(joint.name for joint in turned if joint is not None)
        if len(names) >= FEWEST_SWIVELS:
            return f'a base that steers all its wheels ({", ".join(names)})'
    if not steering:
        return ''
    steers = f'{steering[0]} steers'
    if len(steering) > 1:
        return f'a car (Ackermann: {steers} a wheel)'
    axle = [name for name, joint in by.items() if joint is not None]
    if len(axle) > 1:
        return f'an articulated vehicle ({steers} {" and ".join(axle)} together)'
    return f'a {"tricycle" if len(held) > 1 else "bicycle"} ({steers} its wheel)'


def _rolling_rim(rollers: Sequence[Roller]) -> str:
    """Return which wheel has small ones on its rim, and how these lie; nothing where none has."""
    for roller in rollers:
        if len(roller.beads) >= FEWEST_BEADS:
            angles = [math.acos(min(1.0, abs(float(roller.axis @ axis)))) for axis in roller.beads]
            angle = math.degrees(float(np.median(angles)))
            return f'{roller.joint.name} has {len(angles)} rollers at {angle:.3g} degrees'
    return ''


def _named(robot: Robot, wanted: set[str], also: set[str]) -> list[str]:
    """Return the joints of links with a shape whose names and meshes have words of two sets."""
    found = []
    for joint in robot.joints.values():
        shapes = robot.links[joint.child].shapes
        meshes = [PurePosixPath(shape.url).stem for shape in shapes if shape.url]
        said = {word for name in (joint.name, joint.child, *meshes) for word in words(name)}
        if shapes and said & wanted and said & also and not said & CASTER_WORDS:
            found.append(joint.name)
    return found


def _slanted(robot: Robot, rollers: Sequence[Roller]) -> list[str]:
    """Return the wheels that Gazebo lets slide aslant, `<fdir1>`, as mecanum ones are made of."""
    aslant = set()
    for tag in robot.gazebo:
        text = (tag.findtext('fdir1') or '').split()
        try:
            x, y, _ = (abs(float(word)) for word in text)
        except ValueError:
            continue
        if min(x, y) > math.sin(CROSSED) * math.hypot(x, y):
            aslant.add(tag.get('reference'))
    return [each.joint.name for each in rollers if each.joint.child in aslant]


def _crossed(rollers: Sequence[Roller]) -> str:
    """Return which two wheels of three or more roll across each other, if any do."""
    largest = max((roller.radius for roller in rollers), default=0.0)
    bearing = [
        roller
        for roller in rollers
        if not any(joint.kind != 'prismatic' for joint in roller.above)
        and roller.radius >= (1.0 - ALIKE) * largest
        and not {*words(roller.joint.name), *words(roller.joint.child)} & CASTER_WORDS
    ]
    if len(bearing) < FEWEST_ROLLERS:
        return ''
    first, *others = bearing
    for other in others:
        angle = math.acos(min(1.0, abs(float(first.axis @ other.axis))))
        if angle > CROSSED:
            return (
                f'{first.joint.name} and {other.joint.name} turn about axes '
                f'{math.degrees(angle):.3g} degrees apart'
            )
    return ''
