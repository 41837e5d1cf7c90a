# SPDX-License-Identifier: Apache-2.0
"""What of a robot touches what, and how."""

import itertools

import mujoco
import numpy as np

from robot_description.mujoco_visuals import COLLISION_GROUP
from robot_description.urdf import Robot
from robot_description.urdf_shapes import Shape

# Contact that holds a wheel where its odometry says it is: stiffer contacts slip less. Measured
# on mbot, 360 degrees on the spot: 0.18 degrees off at 0.01 s, 0.03 at 0.004 s.
SOLREF = (0.004, 1.0)


def name_collisions(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Call what a link collides with `LINK/0`, `LINK/1`, ..."""
    for link in robot.links:
        for index, (_, geom) in enumerate(_colliding(spec, robot, link)):
            geom.name = f'{link}/{index}'
            if geom.type == mujoco.mjtGeom.mjGEOM_CYLINDER:
                _tilt(geom)


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


def set_contacts(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Give links that name a friction their contact; what rolls gets a stiff one in one point."""
    rolling = {joint.child for joint in robot.movable_joints if joint.kind == 'continuous'}
    for name, friction in robot.friction.items():
        for shape, geom in _colliding(spec, robot, name):
            geom.priority = 1  # this friction counts, whatever lies on the floor
            geom.friction[0] = friction
            geom.condim = 3 if friction > 0.0 else 1
            if name in rolling:
                geom.solref = SOLREF
            if shape.kind == 'cylinder' and _is_wheel(robot, name, shape):
                _round_off(geom, shape)


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


def _colliding(spec: mujoco.MjSpec, robot: Robot, link: str) -> list[tuple[Shape, mujoco.MjsGeom]]:
    body = spec.body(link)
    if body is None or link not in robot.links:  # welded on, or a tag's reference to nothing
        return []
    geoms = [geom for geom in body.geoms if geom.group == COLLISION_GROUP]
    return list(zip(robot.links[link].collisions, geoms, strict=False))


def _is_wheel(robot: Robot, link: str, cylinder: Shape) -> bool:
    """Whether the cylinder turns about its own axis on a continuous joint."""
    for joint in robot.joints.values():
        if joint.child == link and joint.kind == 'continuous':
            return bool(abs(cylinder.pose.rotation[:, 2] @ joint.axis) > 1.0 - 1e-6)
    return False


def _round_off(geom: mujoco.MjsGeom, cylinder: Shape) -> None:
    """
    Replace a cylinder by the ellipsoid inside it.

    A flat tread touches in two points, which fight every turn.
    """
    radius, length = cylinder.size
    geom.type = mujoco.mjtGeom.mjGEOM_ELLIPSOID
    geom.size = np.array([radius, radius, length / 2.0])
