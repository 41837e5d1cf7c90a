# SPDX-License-Identifier: Apache-2.0
"""What else drives on wheels, by its shape and its names: cars, mecanum, tracks, skid-steers."""

from collections.abc import Sequence
import math
from pathlib import PurePosixPath

import numpy as np

from robot_description.morphology import words
from robot_description.robot import Joint
from robot_description.robot import Robot

# An axis that is upright within this [rad] steers or swivels.
UPRIGHT = math.radians(30.0)
# Axes of wheels that stand in each other's way by more than this [rad] are those of an omni base.
CROSSED = math.radians(15.0)
WHEEL_WORDS = {'wheel', 'wheels', 'tire', 'tyre', 'tires', 'tyres'}
CASTER_WORDS = {'caster', 'castor', 'casters', 'castors', 'swivel'}
STEER_WORDS = {'steer', 'steering', 'steered', 'ackermann', 'ackerman'}
ROLLER_WORDS = {'mecanum', 'omni', 'omniwheel', 'swedish', 'roller', 'rollers'}
TRACK_WORDS = {'track', 'tracks', 'crawler', 'crawlers', 'caterpillar'}
# A vehicle with so many wheels on a side has them in tracks; a name says so of so many parts.
TRACK_WHEELS = 4
FEWEST_ROLLERS, FEWEST_TRACKS = 3, 2
# A joint with less room than this [rad] steers; a caster swivels all around.
STEERING_RANGE = 6.0

Place = tuple[Joint, np.ndarray]


def is_upright(robot: Robot, joint: Joint) -> bool:
    """Whether a joint turns about an axis that is upright where the robot rests."""
    axis = robot.rest_poses[joint.child].rotation @ joint.axis
    return joint.kind != 'prismatic' and abs(float(axis[2])) > math.cos(UPRIGHT)


def other_vehicle(robot: Robot, wheels: Sequence[Place]) -> str:
    """
    Return what a robot is that two driven wheels do not make, in words after `is`; else nothing.

    `wheels` are the joints of those that the base holds, with the wheels' places in the root [m].
    """
    above = _above_wheels(robot)
    for joint in robot.movable_joints:
        if joint.child in above and _steers(robot, joint):
            return f'a car (Ackermann: {joint.name} steers a wheel)'
    rollers = _named(robot, ROLLER_WORDS, WHEEL_WORDS)
    if len(rollers) >= FEWEST_ROLLERS:
        return f'a mecanum or omni base ({", ".join(rollers)})'
    crossed = _crossed(robot)
    if crossed:
        return f'a mecanum or omni base ({crossed})'
    tracks = _named(robot, TRACK_WORDS, TRACK_WORDS)
    if len(tracks) >= FEWEST_TRACKS:
        return f'a tracked vehicle ({", ".join(tracks)})'
    left = sum(place[1] > 0.0 for _, place in wheels)
    return f'a tracked vehicle ({left} wheels on the left)' if left >= TRACK_WHEELS else ''


def _steers(robot: Robot, joint: Joint) -> bool:
    """Whether a joint steers what it carries: about an upright axis, by its name or its limits."""
    said = {*words(joint.name), *words(joint.child)}
    if said & CASTER_WORDS or not is_upright(robot, joint):
        return False
    return bool(said & STEER_WORDS) or joint.upper - joint.lower < STEERING_RANGE


def _above_wheels(robot: Robot) -> set[str]:
    """Return the links that are called wheels, and those that carry one."""
    found: set[str] = set()
    for link in reversed(robot.links_from_root[1:]):
        joint = robot.parent_joints[link]
        if link in found or WHEEL_WORDS & {*words(joint.name), *words(link)}:
            found |= {link, joint.parent}
    return found


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


def _crossed(robot: Robot) -> str:
    """Return which two wheels of three or more roll across each other, if any do."""
    axes = {
        joint.name: robot.rest_poses[joint.child].rotation @ joint.axis
        for joint in robot.movable_joints
        if joint.kind == 'continuous'
        and {*words(joint.name), *words(joint.child)} & WHEEL_WORDS
        and not {*words(joint.name), *words(joint.child)} & CASTER_WORDS
        and robot.carriers[joint.parent] == robot.root
    }
    level = {name: axis for name, axis in axes.items() if abs(axis[2]) < math.sin(UPRIGHT)}
    if len(level) < FEWEST_ROLLERS:
        return ''
    (first, axis), *others = level.items()
    for name, other in others:
        angle = math.acos(min(1.0, abs(float(axis @ other))))
        if angle > CROSSED:
            return f'{first} and {name} turn about axes {math.degrees(angle):.3g} degrees apart'
    return ''
