# SPDX-License-Identifier: Apache-2.0
"""The two driven wheels of a robot, and what other people's descriptions do not say of them."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
import math
from typing import NamedTuple

import numpy as np
from wasd_core.robot_io import GRAVITY

from robot_description.robot import Joint
from robot_description.robot import Robot
from robot_description.robot import Shape

# How exactly an axis has to point along y: exporters write 1.57 for a right angle.
ALONG = 1.0 - 1e-6
# Lengths in a description that differ by less than this [m] are meant to be equal.
TOLERANCE = 1e-6
# What hangs at most so much higher than the wheels' lowest point [m] is there to touch the floor.
FLOOR_GAP = 0.003
# A motor that a description does not speak of: rim speed [m/s], and torque as a multiple of what
# makes a wheel slip on a floor with friction 1.
RIM_SPEED = 1.5
TORQUE_SHARE = 2.0
TYRE_FRICTION = 1.0


class DriveWheel(NamedTuple):
    """A wheel: joint, centre in the root [m], radius [m], sign of its axis along y."""

    joint: Joint
    position: np.ndarray
    radius: float
    direction: int


def drive_wheels(robot: Robot, names: Sequence[str] = ()) -> list[DriveWheel]:
    """
    Return the driven wheels, left first; not two of them where the robot has no such pair.

    They are round, turn about y on continuous joints that nothing else moves, and sit beside each
    other on one axle. Of several pairs the larger one drives: casters are smaller. With `names`,
    only these joints are looked at.
    """
    joints = [joint for joint in robot.movable_joints if not names or joint.name in names]
    found = [wheel for wheel in (_wheel(robot, joint) for joint in joints) if wheel]
    pairs = [pair for pair in combinations(found, 2) if _is_axle(*pair)]
    if pairs:
        largest = max(pair[0].radius for pair in pairs)
        pairs = [pair for pair in pairs if pair[0].radius > largest - TOLERANCE]
    chosen = pairs[0] if len(pairs) == 1 else found
    return sorted(chosen, key=lambda wheel: -float(wheel.position[1]))


def equip_drive(robot: Robot) -> Robot:
    """
    Return the robot with what its two driven wheels need and its description leaves out.

    It adds motors, tyres with grip, and casters without friction, which are the links that touch
    the floor beside the wheels. What the description says is kept.
    """
    wheels = drive_wheels(robot)
    if len(wheels) != 2:
        return robot
    joints, friction = dict(robot.joints), dict(robot.friction)
    for wheel in wheels:
        joint = wheel.joint
        torque = 0.5 * TORQUE_SHARE * robot.mass * GRAVITY * wheel.radius
        joints[joint.name] = replace(
            joint,
            effort=joint.effort if joint.effort > 0.0 else torque,
            velocity=joint.velocity if joint.velocity > 0.0 else RIM_SPEED / wheel.radius,
        )
        friction.setdefault(joint.child, TYRE_FRICTION)
    floor = min(float(wheel.position[2]) - wheel.radius for wheel in wheels)
    for link in robot.links:
        if lowest_point(robot, link) <= floor + FLOOR_GAP:
            friction.setdefault(link, 0.0)
    return replace(robot, joints=joints, friction=friction)


def lowest_point(robot: Robot, link: str | None = None) -> float:
    """
    Return the least z that collides in the root's frame [m], of a link or of all.

    Meshes do not count; where nothing collides what is drawn does.
    """
    collides = any(each.collisions for each in robot.links.values())
    links = [robot.links[link]] if link is not None else robot.links.values()
    heights = (
        float(pose.position[2]) - _reach_down(shape, pose.rotation[2])
        for each in links
        for shape in (each.collisions if collides else each.visuals)
        for pose in [robot.rest_poses[each.name] @ shape.pose]
    )
    return min(heights, default=math.inf)


def _reach_down(shape: Shape, up: np.ndarray) -> float:
    """Return how far a shape reaches below its centre [m]; `up` is z in its axes."""
    if shape.kind == 'sphere':
        return shape.size[0]
    if shape.kind == 'box':
        return 0.5 * float(np.abs(up) @ np.array(shape.size))
    if shape.kind == 'capsule':
        radius, length = shape.size
        return radius + 0.5 * length * abs(float(up[2]))
    if shape.kind == 'cylinder':
        radius, length = shape.size
        return radius * math.hypot(up[0], up[1]) + 0.5 * length * abs(float(up[2]))
    return -math.inf


def _wheel(robot: Robot, joint: Joint) -> DriveWheel | None:
    axis = robot.rest_poses[joint.child].rotation @ joint.axis
    if joint.kind != 'continuous' or abs(axis[1]) < ALONG or not _is_held_by_base(robot, joint):
        return None
    link = robot.links[joint.child]
    for shape in (*link.collisions, *link.visuals):
        is_disc = shape.kind == 'cylinder' and abs(shape.pose.rotation[:, 2] @ joint.axis) > ALONG
        if is_disc or shape.kind == 'sphere':
            centre = robot.rest_poses[joint.child] @ shape.pose
            direction = 1 if axis[1] > 0.0 else -1
            return DriveWheel(joint, centre.position, shape.size[0], direction)
    return None


def _is_held_by_base(robot: Robot, joint: Joint) -> bool:
    """Whether nothing moves between the root and the joint, as a caster's swivel does."""
    above = robot.parent_joints.get(joint.parent)
    while above is not None:
        if above.kind != 'fixed':
            return False
        above = robot.parent_joints.get(above.parent)
    return True


def _is_axle(a: DriveWheel, b: DriveWheel) -> bool:
    """Whether two wheels of one size sit beside each other."""
    x, y, z = np.abs(a.position - b.position).tolist()
    return bool(
        abs(a.radius - b.radius) < TOLERANCE and x < TOLERANCE and z < TOLERANCE and y > TOLERANCE
    )
