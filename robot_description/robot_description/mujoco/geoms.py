# SPDX-License-Identifier: Apache-2.0
"""What is drawn of a robot in MuJoCo, what collides, and how it touches."""

from collections.abc import Callable, Collection, Mapping
import itertools
import logging
import math
from pathlib import Path

import mujoco
import numpy as np
from wasd_core.errors import DescriptionError
from wasd_core.rotations import Origin

from robot_description.meshes.load import Detail, load_mesh
from robot_description.mujoco.renderer import has_graphics_card
from robot_description.robot import Colour, Link, Robot, Shape

# Without a handler Python writes warnings to standard error, a line each.
LOGGER = logging.getLogger(__name__)
# A visual mesh is drawn whole by a graphics card, unless it is huge. Without one, a picture of a
# robot whose meshes have ten times as many triangles takes three times as long; these keep the
# letters on a Go2's trunk and the edges of its shell.
WHOLE, THINNED = Detail(1.0, 20_000, 20_000), Detail(0.35, 3000, 6000)
# A flat mesh collides as a plate of this thickness [m]; flat is what is thinner than this share of
# its size.
PLATE, FLAT = 1e-3, 1e-5
VISUAL_GROUP = 2
COLLISION_GROUP = 3
# What a kind of shape is, and its size: halves of a box's edges and of a cylinder's or
# capsule's length.
TYPES: dict[str, tuple[int, Callable[..., list[float]]]] = {
    'box': (mujoco.mjtGeom.mjGEOM_BOX, lambda x, y, z: [x / 2.0, y / 2.0, z / 2.0]),
    'cylinder': (mujoco.mjtGeom.mjGEOM_CYLINDER, lambda radius, h: [radius, h / 2.0, 0.0]),
    'capsule': (mujoco.mjtGeom.mjGEOM_CAPSULE, lambda radius, h: [radius, h / 2.0, 0.0]),
    'sphere': (mujoco.mjtGeom.mjGEOM_SPHERE, lambda radius: [radius, 0.0, 0.0]),
    'mesh': (mujoco.mjtGeom.mjGEOM_MESH, lambda: [0.0, 0.0, 0.0]),
}
# What collides looks like what is drawn before it in its link, or else as MuJoCo has it.
PLAIN: Colour = (0.5, 0.5, 0.5, 1.0)
# Contact that holds a wheel where its odometry says it is: stiffer contacts slip less. Measured
# on mbot, 360 degrees on the spot: 0.18 degrees off at 0.01 s, 0.03 at 0.004 s.
SOLREF = (0.004, 1.0)
# Casters give way by less than a millimetre, as those on springs and rubber do: on hard ones a
# robot would hang, and its driven wheels turn in the air, where these are drawn a hair too high.
SOFT = (0.025, 1.0)
# Cylinders are turned by a hair [rad]. What stands upright where the robot rests, to 1e-3 rad, is
# turned by more: MuJoCo takes up to 2e-6 rad from the axes of a body for none. At a radius of
# 0.2 m that is less than a micrometre.
TILT, STANDING_TILT, UPRIGHT = 1e-6, 4e-6, math.cos(1e-3)


class MissingMesh(Exception):
    """There is no such mesh, or it cannot be read."""


class Meshes:
    """The meshes of a specification, each file at each scale once; `files` has them by URL."""

    def __init__(self, spec: mujoco.MjSpec, files: Mapping[str, Path]) -> None:
        self._spec = spec
        self._files = files
        self._detail = WHOLE if has_graphics_card() else THINNED
        self._names: dict[tuple[object, ...], str | MissingMesh] = {}

    def name_of(self, shape: Shape) -> str:
        """
        Return the name of a shape's mesh in the specification, into which it is loaded.

        Raises:
            MissingMesh: it is not found, or cannot be read.
        """
        use = (shape.url, shape.scale, shape.collides)
        if use not in self._names:
            self._names[use] = self._load(shape)
        name = self._names[use]
        if isinstance(name, MissingMesh):
            raise name
        return name

    def _load(self, shape: Shape) -> str | MissingMesh:
        path = self._files.get(shape.url)
        if path is None or not all(shape.scale):
            return MissingMesh(f'mesh {shape.url} not found')
        try:
            mesh = load_mesh(path, None if shape.collides else self._detail)
        except (OSError, ValueError) as error:
            if not shape.collides:
                LOGGER.warning('description: visual mesh left out: %s', error)
            return MissingMesh(str(error))
        vertices = mesh.vertices * np.array(shape.scale, np.float32)
        # A mirror image is inside out unless its triangles turn the other way.
        faces = mesh.faces[:, ::-1] if np.prod(shape.scale) < 0.0 else mesh.faces
        if shape.collides:
            vertices, faces = _with_body(vertices, faces)
        elif len(vertices) < 4:  # of which MuJoCo wants as many
            vertices = np.concatenate([vertices, vertices[:1]])
        name = f'mesh_{len(self._names)}'
        self._spec.add_mesh(
            name=name,
            uservert=vertices.flatten(),
            userface=faces.flatten(),
            # Masses are the URDF's; computed from its volume, an open surface is an error.
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        return name


def _with_body(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a surface as it is, or as a plate if it is flat: only what has a body has a hull."""
    centred = vertices - vertices.mean(axis=0, dtype=float)
    normal = np.linalg.eigh(centred.T @ centred)[1][:, 0]
    if np.ptp(centred @ normal) > FLAT * np.ptp(vertices, axis=0).max():
        return vertices, faces
    half = 0.5 * PLATE * normal
    both = np.concatenate([vertices + half, vertices - half]).astype(np.float32)
    return both, np.concatenate([faces, faces[:, ::-1] + len(vertices)])


def quaternion(origin: Origin) -> np.ndarray:
    """Return the rotation of a URDF's origin as MuJoCo's quaternion w, x, y, z, shape (4,)."""
    result = np.zeros(4)
    mujoco.mju_euler2Quat(result, np.array(origin.rpy), 'XYZ')  # about axes that stand still
    return result


def add_geoms(
    body: mujoco.MjsBody, link: Link, robot: Robot, meshes: Meshes, visuals: bool
) -> None:
    """
    Give a link's body what collides, called `LINK/0`, `LINK/1`, ..., and what is drawn.

    Without `visuals` only what collides. A visual mesh that is missing is left out; the link then
    shows what it collides with.

    Raises:
        DescriptionError: a mesh that collides is missing or cannot be read.
    """
    colliding: list[mujoco.MjsGeom] = []
    colour = PLAIN
    is_whole = True
    for shape in link.shapes:
        if not shape.collides:
            colour = shape.rgba
            if not visuals:
                continue
        if shape.kind != 'mesh' and min(shape.size) <= 0.0:
            size = ' x '.join(f'{edge:g}' for edge in shape.size)
            raise DescriptionError(
                f'link {link.name!r} has a {shape.kind} of {size} m: wanted numbers above zero'
            )
        try:
            geom = _add_geom(body, shape, colour, meshes)
        except MissingMesh as why:
            if shape.collides:
                raise DescriptionError(
                    f'link {link.name!r} collides with what is not: {why}'
                ) from None
            is_whole = False
            continue
        if shape.collides:
            geom.name = f'{link.name}/{len(colliding)}'
            set_contact(geom, robot, link.name, shape)
            colliding.append(geom)
    if not is_whole:
        for geom in colliding:
            _draw(body, geom)


def _draw(body: mujoco.MjsBody, geom: mujoco.MjsGeom) -> None:
    """Draw what collides; rays go on seeing the geom itself, and not what is drawn."""
    body.add_geom(
        type=geom.type,
        size=geom.size,
        pos=geom.pos,
        quat=geom.quat,
        meshname=geom.meshname,
        rgba=geom.rgba,
        group=VISUAL_GROUP,
        contype=0,
        conaffinity=0,
        mass=0.0,
    )


def _add_geom(
    body: mujoco.MjsBody, shape: Shape, colour: Colour, meshes: Meshes
) -> mujoco.MjsGeom:
    kind, size = TYPES[shape.kind]
    return body.add_geom(
        type=kind,
        size=size(*shape.size),
        pos=shape.pose.position,
        quat=quaternion(shape.pose),
        meshname=meshes.name_of(shape) if shape.kind == 'mesh' else '',
        rgba=colour,
        group=COLLISION_GROUP if shape.collides else VISUAL_GROUP,
        contype=int(shape.collides),
        conaffinity=int(shape.collides),
        mass=0.0,  # else MuJoCo weighs the shapes of links without an inertial
    )


def set_contact(geom: mujoco.MjsGeom, robot: Robot, link: str, shape: Shape) -> None:
    """
    Say how a colliding shape of a link touches.

    A link that names a friction gets it; what rolls a stiff contact, in one point.
    """
    if shape.kind == 'cylinder':
        up = float(robot.zero_poses[link].rotation[2] @ shape.pose.rotation[:, 2])
        _tilt(geom, STANDING_TILT if abs(up) > UPRIGHT else TILT)
    if link not in robot.friction:
        return
    friction = robot.friction[link]
    geom.priority = 1  # this friction counts, whatever lies on the floor
    geom.friction[0] = friction
    geom.condim = 3 if friction > 0.0 else 1
    joint = robot.parent_joints.get(link)
    if link in robot.casters:
        geom.solref = SOFT
    elif joint is not None and joint.kind == 'continuous':
        geom.solref = SOLREF
    if joint is None or joint.kind != 'continuous':
        return
    # A cylinder that turns about its own axis is a wheel.
    if shape.kind == 'cylinder' and abs(shape.pose.rotation[:, 2] @ joint.axis) > 1.0 - 1e-6:
        _round_off(geom, shape)


def _tilt(geom: mujoco.MjsGeom, angle: float) -> None:
    """
    Turn a cylinder by a hair [rad].

    MuJoCo 4.0.0 gives a cylinder that stands on a plane upright to 1e-15 a contact as deep as it
    is wide: the direction to its rim is then a quotient of rounding errors. mbot's drum, which
    does not even touch the floor, was thrown into the air by it.
    """
    turned = np.zeros(4)
    mujoco.mju_mulQuat(turned, geom.quat, np.array([1.0, 0.5 * angle, 0.0, 0.0]))
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
    for loner in _isolated_carriers(robot):
        pairs |= {frozenset((loner, other)) for other in bodies if other != loner}
    order = list(robot.links)
    for pair in sorted(sorted(pair, key=order.index) for pair in pairs):
        one, other = (bodies.get(carrier, []) for carrier in pair)
        for first, second in itertools.product(one, other):
            spec.add_exclude(bodyname1=first, bodyname2=second)


def exclude_all(spec: mujoco.MjSpec, robot: Robot, carriers: Collection[str]) -> None:
    """Let what these carriers carry overlap."""
    found = _colliding_bodies(robot)
    bodies = [body for carrier in carriers for body in found.get(carrier, [])]
    for first, second in itertools.combinations(sorted(bodies, key=list(robot.links).index), 2):
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


def _isolated_carriers(robot: Robot) -> list[str]:
    """Return the carriers none of whose links may touch the robot, as the gazebo tags have it."""
    said: dict[str, list[bool]] = {}
    for link, collides in robot.self_collide.items():
        if link in robot.carriers:
            said.setdefault(robot.carriers[link], []).append(collides)
    return [carrier for carrier, words in said.items() if not any(words)]
