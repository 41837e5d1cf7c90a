# SPDX-License-Identifier: Apache-2.0
"""What of a joint's links rolls: whether it turns freely, is round about its axis, how large."""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.rotations import IDENTITY, Pose

from robot_description.meshes.load import mesh_points
from robot_description.robot import Joint, Link, Robot, Shape

# Angles of a description that differ by no more than this are meant to be equal: CAD rounds to
# 0.5 degrees on each side, exporters write 1.57 for a right angle [rad].
OFF_AXIS = math.radians(1.0)
# Radii that differ by no more than this share of the larger one are alike; nor is a mesh rounder.
OFF_RADIUS = 0.1
# A wheel's centre of mass is off its axle by more than this share of its radius, and this [m].
OFF_BALANCE, LEAST_OFF_BALANCE = 0.1, 0.005
# A wheel turns freely, or by more than this [rad]: some exporters know no continuous joint.
FULL_TURN = 2.0 * math.pi
# So exactly along the joint's axis a cylinder needs no other in its place.
EXACT = 1.0 - 1e-6
# Directions about a wheel's axis in which its mesh is measured.
DIRECTIONS = 16
# A wheel whose shapes say no width [m].
USUAL_WIDTH = 0.02


class Tyre(NamedTuple):
    """What rolls: middle (3,) in the link [m], radius and width [m]; as it is, or to be put in."""

    centre: np.ndarray
    radius: float
    width: float
    is_exact: bool


def turns_freely(joint: Joint) -> bool:
    """Whether a joint goes round."""
    return joint.kind == 'continuous' or (
        joint.kind == 'revolute' and joint.upper - joint.lower >= FULL_TURN
    )


def find_tyre(robot: Robot, joint: Joint, radius: float) -> Tyre | str:
    """
    Return what of a joint's links is round about its axis, or why nothing is.

    The largest of what collides, as a hub may have its own shape, and of a wheel that is only
    drawn; where nothing collides, of all that is drawn.
    """
    why, parts = 'has no shape', carried(robot, joint.child)
    for collides in (any(link.collisions for link, _ in parts), False):
        tyres = []
        for link, pose in parts:
            is_wheel = link.name == joint.child
            is_drawn = not collides or (is_wheel and not link.collisions)
            for shape in link.visuals if is_drawn else link.collisions:
                tyre = _measure(robot, joint.axis, shape, pose @ shape.pose)
                if isinstance(tyre, str):
                    why = tyre
                elif tyre.radius <= 0.0:
                    why = f'has a {shape.kind} without a radius'
                else:
                    own = tyre.is_exact and is_wheel and not is_drawn
                    tyres.append(tyre._replace(is_exact=own))
        if tyres:
            return max(tyres, key=lambda tyre: (tyre.radius, tyre.is_exact))
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


def imbalance(robot: Robot, joint: Joint) -> float:
    """Return how far the centre of mass of what a joint turns is off its axis [m]."""
    masses = [
        (link.mass, (pose @ link.inertial).position) for link, pose in carried(robot, joint.child)
    ]
    total = sum(mass for mass, _ in masses)
    if total <= 0.0:
        return 0.0
    centre = sum((mass * place for mass, place in masses), np.zeros(3)) / total
    return float(np.linalg.norm(np.cross(joint.axis, centre)))


def is_unbalanced(robot: Robot, joint: Joint, radius: float) -> bool:
    """Whether a wheel of a radius [m] has its mass further off its axle than CAD's rounding."""
    return imbalance(robot, joint) > max(OFF_BALANCE * radius, LEAST_OFF_BALANCE)


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
        what = f'missing mesh ({shape.url})' if shape.url else shape.kind
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
    if differ(shortest, longest) > OFF_RADIUS:
        return (
            f'has a mesh that reaches from {shortest:.3g} to {longest:.3g} m from the axis '
            f'({100 * OFF_RADIUS:g} % are round)'
        )
    along = points @ axis
    middle = 0.5 * float(along.min() + along.max())
    return Tyre(middle * axis, longest, float(np.ptp(along)), is_exact=False)


def differ(one: float, other: float) -> float:
    """Return by which share of the larger one two lengths differ."""
    return abs(one - other) / max(one, other, 1e-12)
