# SPDX-License-Identifier: Apache-2.0
"""What a robot rolls on: round parts on the ground that turn freely, and what steers them."""

from collections.abc import Sequence
import math
from typing import NamedTuple

import numpy as np
from wasd_core.rotations import Pose

from robot_description.morphology.names import words
from robot_description.morphology.tyre import carried, find_tyre, OFF_RADIUS, turns_freely
from robot_description.robot import Joint, Robot

# An axis that is upright within this [rad] steers or swivels.
UPRIGHT = math.radians(30.0)
# What is higher above the lowest of them than this share of its radius is not on the ground.
LIFTED = 0.5
# A joint with less room than this [rad] steers; a caster swivels all around.
STEERING_RANGE = 6.0
# A part that is so far behind its upright axis [m] trails, as casters do.
TRAIL = 0.005
# Between what steers and what rolls there is a spring at most.
MOST_BETWEEN = 1
# What is held by so many joints that bend is at the end of a leg.
LEG_JOINTS = 2
CASTER_WORDS = {'caster', 'castor', 'casters', 'castors', 'swivel'}
STEER_WORDS = {'steer', 'steering', 'steered', 'ackermann', 'ackerman'}


class Roller(NamedTuple):
    """
    A round part on the ground.

    `position` is its centre in the root [m], `axis` (3,) its axis there; `radius` [m] is that of
    the largest where its own shape is not to be had: then it is not measured. `above` are the
    joints that move it, from its own holder up to the root; `beads` are the axes of the small
    parts that turn on its rim, as a mecanum wheel has them.
    """

    joint: Joint
    position: np.ndarray
    axis: np.ndarray
    radius: float
    above: tuple[Joint, ...]
    beads: tuple[np.ndarray, ...] = ()
    is_measured: bool = True

    @property
    def bottom(self) -> float:
        """Its lowest point in the root [m]."""
        return float(self.position[2]) - self.radius


def is_upright(robot: Robot, joint: Joint) -> bool:
    """Whether a joint turns about an axis that is upright where the robot rests."""
    axis = robot.zero_poses[joint.child].rotation @ joint.axis
    return joint.kind != 'prismatic' and abs(float(axis[2])) > math.cos(UPRIGHT)


def joints_above(robot: Robot, joint: Joint) -> tuple[Joint, ...]:
    """Return the joints that are not fixed on the way from a joint to the root."""
    found: list[Joint] = []
    above = robot.parent_joints.get(joint.parent)
    while above is not None:
        if above.kind != 'fixed':
            found.append(above)
        above = robot.parent_joints.get(above.parent)
    return tuple(found)


def find_rollers(robot: Robot) -> list[Roller]:
    """Return what a robot rolls on, in the order of the file."""
    every = [roller for joint in robot.movable_joints for roller in _roller(robot, joint)]
    wheels = {roller.joint.name: roller for roller in every}
    beads: dict[str, list[np.ndarray]] = {name: [] for name in wheels}
    for roller in every:
        outer = reversed(roller.above)  # the shaft, where it turns a hub: that is itself no wheel
        carrier = next((wheels[each.name] for each in outer if each.name in wheels), None)
        if carrier is not None:
            off = np.cross(carrier.axis, roller.position - carrier.position)
            if float(np.linalg.norm(off)) > roller.radius:  # else a gear around its axle
                beads[carrier.joint.name].append(roller.axis)
            del wheels[roller.joint.name]
    usual = max((roller.radius for roller in wheels.values()), default=0.0)
    found = [
        roller._replace(radius=roller.radius or usual, beads=tuple(beads[name]))
        for name, roller in wheels.items()
    ]
    ground = min((roller.bottom for roller in found), default=0.0)
    return [each for each in found if each.bottom <= ground + max(LIFTED * each.radius, TRAIL)]


def rolling_joints(robot: Robot) -> frozenset[str]:
    """Return the joints that turn a round part, and those that steer what a robot rolls on."""
    round_parts = {joint.name for joint in robot.movable_joints if _roller(robot, joint)}
    steering = {joint.name for roller in find_rollers(robot) for joint in roller.above}
    return frozenset(round_parts | steering)


def _roller(robot: Robot, joint: Joint) -> list[Roller]:
    """Return the round part that a joint turns freely about a level axis, or nothing."""
    frame = robot.zero_poses[joint.child]
    axis = frame.rotation @ joint.axis
    if not turns_freely(joint) or abs(float(axis[2])) > math.sin(UPRIGHT):
        return []
    tyre = find_tyre(robot, joint, 0.0)
    above = joints_above(robot, joint)
    if not isinstance(tyre, str):
        off = float(np.linalg.norm(np.cross(joint.axis, tyre.centre)))
        if off > max(OFF_RADIUS * tyre.radius, TRAIL):
            return []  # the foot of a leg whose knee knows no stops
        centre = (frame @ Pose(tyre.centre, np.eye(3))).position
        return [Roller(joint, centre, axis, tyre.radius, above)]
    if not _is_lost(robot, joint):
        return []
    return [Roller(joint, frame.position, axis, 0.0, above, is_measured=False)]


def _is_lost(robot: Robot, joint: Joint) -> bool:
    """Whether a wheel may be here whose shape nobody has: a lost mesh, or all of it is its rim."""
    group = [link for link, _ in carried(robot, joint.child)]
    shapes = [shape for link in group for shape in link.shapes]
    if not shapes and any(link.mass > 0.0 for link in group):
        return True
    lost = any(shape.url and shape.url not in robot.mesh_files for shape in shapes)
    return lost or sum(each.parent == joint.child for each in robot.movable_joints) > LEG_JOINTS


def is_on_leg(roller: Roller, robot: Robot) -> bool:
    """
    Whether a part is at the end of a leg: joints that bend hold it, by motors.

    Where no joint has a motor, none is looked for.
    """
    has_motors = any(joint.effort > 0.0 for joint in robot.movable_joints)
    bends = [
        joint
        for joint in roller.above
        if joint.kind in ('revolute', 'continuous')
        and not is_upright(robot, joint)
        and (joint.effort > 0.0 or not has_motors)
    ]
    return len(bends) >= LEG_JOINTS


def steered_by(roller: Roller, rollers: Sequence[Roller], robot: Robot) -> Joint | None:
    """
    Return the joint that steers a part: about z, and by a motor.

    It has less than a turn of room, or what it carries is as large as any other part, and stands
    under its axis. None of a caster, which swivels all around, or has no motor; of what carries
    all that the robot rolls on, as a waist does; of the end of a leg.
    """
    joint = turned_by(roller, robot)
    if joint is None or is_on_leg(roller, robot) or carries_all(joint, rollers):
        return None
    said = {*words(joint.name), *words(joint.child)}
    if said & CASTER_WORDS or _is_loose(joint, roller, rollers, robot):
        return None
    has_stops = joint.upper - joint.lower < STEERING_RANGE
    is_one = has_stops or said & STEER_WORDS or _stands_under(joint, roller, rollers, robot)
    return joint if is_one else None


def turned_by(roller: Roller, robot: Robot) -> Joint | None:
    """Return the upright joint that turns a part as a whole, a caster's or a steering's."""
    near = roller.above[: MOST_BETWEEN + 1]
    return next((joint for joint in near if is_upright(robot, joint)), None)


def carries_all(joint: Joint, rollers: Sequence[Roller]) -> bool:
    """Whether a joint moves all that a robot rolls on, as the waist of one with a torso does."""
    return len(rollers) > 1 and all(joint in each.above for each in rollers)


def _is_loose(joint: Joint, roller: Roller, rollers: Sequence[Roller], robot: Robot) -> bool:
    """Whether no motor turns a joint, where others have one or what it carries trails."""
    if joint.effort > 0.0:
        return False
    return any(each.joint.effort > 0.0 for each in rollers) or _trail(joint, roller, robot) > TRAIL


def _stands_under(joint: Joint, roller: Roller, rollers: Sequence[Roller], robot: Robot) -> bool:
    """Whether a motor turns a part as large as any, right under its axis: no caster is so."""
    is_large = roller.radius >= (1.0 - OFF_RADIUS) * max(each.radius for each in rollers)
    return joint.effort > 0.0 and is_large and _trail(joint, roller, robot) <= TRAIL


def _trail(joint: Joint, roller: Roller, robot: Robot) -> float:
    """Return how far a part is from the upright axis that turns it [m]."""
    off = (roller.position - robot.zero_poses[joint.child].position)[:2]
    return float(np.hypot(*off))
