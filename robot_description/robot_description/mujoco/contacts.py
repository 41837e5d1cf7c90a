# SPDX-License-Identifier: Apache-2.0
"""What of a robot touches what, and how."""

import itertools

import mujoco
import numpy as np

from robot_description.urdf import Robot
from robot_description.urdf_shapes import Shape

# Contact that holds a wheel where its odometry says it is: stiffer contacts slip less. Measured
# on mbot, 360 degrees on the spot: 0.18 degrees off at 0.01 s, 0.03 at 0.004 s.
SOLREF = (0.004, 1.0)


def set_contact(geom: mujoco.MjsGeom, robot: Robot, link: str, shape: Shape) -> None:
    """
    Say how a colliding shape of a link touches.

    A link that names a friction gets it; what rolls a stiff contact, in one point.
    """
    if shape.kind == 'cylinder':
        _tilt(geom)
    if link not in robot.friction:
        return
    friction = robot.friction[link]
    geom.priority = 1  # this friction counts, whatever lies on the floor
    geom.friction[0] = friction
    geom.condim = 3 if friction > 0.0 else 1
    joint = robot.parent_joints.get(link)
    if joint is None or joint.kind != 'continuous':
        return
    geom.solref = SOLREF
    # A cylinder that turns about its own axis is a wheel.
    if shape.kind == 'cylinder' and abs(shape.pose.rotation[:, 2] @ joint.axis) > 1.0 - 1e-6:
        _round_off(geom, shape)


def _tilt(geom: mujoco.MjsGeom) -> None:
    """
    Turn a cylinder by a hair, 1e-6 rad.

    MuJoCo 4.0.0 gives a cylinder that stands on a plane upright to 1e-15 a contact as deep as it
    is wide: the direction to its rim is then a quotient of rounding errors. mbot's drum, which
    does not even touch the floor, was thrown into the air by it.
    """
    turned = np.zeros(4)
    mujoco.mju_mulQuat(turned, geom.quat, np.array([1.0, 0.5e-6, 0.0, 0.0]))
    geom.quat = turned


def _round_off(geom: mujoco.MjsGeom, cylinder: Shape) -> None:
    """
    Replace a cylinder by the ellipsoid inside it.

    A flat tread touches in two points, which fight every turn.
    """
    radius, length = cylinder.size
    geom.type = mujoco.mjtGeom.mjGEOM_ELLIPSOID
    geom.size = np.array([radius, radius, length / 2.0])


def exclude_pairs(spec: mujoco.MjSpec, robot: Robot) -> None:
    """
    Let links overlap that always do, and those whose gazebo tag says that they may.

    Links two joints apart do, as a trunk's box and a thigh next to it. A `self_collide` of false
    keeps a link, with what is welded to it, from touching any other of the robot.
    """
    bodies = _colliding_bodies(robot)
    parents = {j.child: robot.carriers[j.parent] for j in robot.movable_joints}
    apart = [(parents[above], link) for link, above in parents.items() if above in parents]
    # MuJoCo lets neighbours overlap by itself, but not those of a body that cannot move.
    beside = list(parents.items()) if robot.is_fixed else []
    pairs = {frozenset(pair) for pair in apart + beside}
    for loner in _loners(robot):
        pairs |= {frozenset((loner, other)) for other in bodies if other != loner}
    order = list(robot.links)
    for pair in sorted(sorted(pair, key=order.index) for pair in pairs):
        one, other = (bodies.get(carrier, []) for carrier in pair)
        for first, second in itertools.product(one, other):
            spec.add_exclude(bodyname1=first, bodyname2=second)


def _colliding_bodies(robot: Robot) -> dict[str, list[str]]:
    """Return the bodies in which what each carrier carries collides: one, where MuJoCo welds."""
    bodies: dict[str, list[str]] = {}
    for link, carrier in robot.carriers.items():
        if robot.links[link].collisions:
            bodies.setdefault(carrier, []).append(link)
    if robot.is_fixed:
        return bodies
    return {carrier: [carrier] for carrier in bodies}


def _loners(robot: Robot) -> list[str]:
    """Return the carriers none of whose links may touch the robot, as the gazebo tags have it."""
    said: dict[str, list[bool]] = {}
    for link, collides in robot.self_collide.items():
        if link in robot.carriers:
            said.setdefault(robot.carriers[link], []).append(collides)
    return [carrier for carrier, words in said.items() if not any(words)]
