# SPDX-License-Identifier: Apache-2.0
"""What is drawn of a robot in MuJoCo and what collides: meshes where found, its primitives."""

from collections.abc import Callable
import logging
from pathlib import Path

import mujoco
import numpy as np
from wasd_core.errors import DescriptionError
from wasd_core.rotations import Origin

from robot_description.meshes import load_mesh
from robot_description.mujoco.contacts import set_contact
from robot_description.urdf import Link
from robot_description.urdf import Robot
from robot_description.urdf_shapes import Colour
from robot_description.urdf_shapes import Shape

# Without a handler Python writes warnings to standard error, a line each.
LOGGER = logging.getLogger(__name__)
# A visual mesh is thinned to so many triangles: a picture of a robot whose meshes have ten times
# as many takes three times as long where there is no graphics card, and looks the same.
PICTURE_FACES = 3000
VISUAL_GROUP = 2
COLLISION_GROUP = 3
# What a kind of shape is, and its size: halves of a box's edges and of a cylinder's length.
TYPES: dict[str, tuple[int, Callable[..., list[float]]]] = {
    'box': (mujoco.mjtGeom.mjGEOM_BOX, lambda x, y, z: [x / 2.0, y / 2.0, z / 2.0]),
    'cylinder': (mujoco.mjtGeom.mjGEOM_CYLINDER, lambda radius, h: [radius, h / 2.0, 0.0]),
    'sphere': (mujoco.mjtGeom.mjGEOM_SPHERE, lambda radius: [radius, 0.0, 0.0]),
    'mesh': (mujoco.mjtGeom.mjGEOM_MESH, lambda: [0.0, 0.0, 0.0]),
}
# What collides looks like what is drawn before it in its link, or else as MuJoCo has it.
PLAIN: Colour = (0.5, 0.5, 0.5, 1.0)

# Returns the file that a mesh URL means, or None.
FindMesh = Callable[[str], Path | None]


class MissingMesh(Exception):
    """There is no such mesh, or it cannot be read."""


class Meshes:
    """The meshes of a specification, each file at each scale once."""

    def __init__(self, spec: mujoco.MjSpec, find: FindMesh) -> None:
        self._spec = spec
        self._find = find
        self._names: dict[tuple[object, ...], str | MissingMesh] = {}

    def name_of(self, shape: Shape) -> str:
        """
        Return the name of a shape's mesh in the specification, into which it is loaded.

        Raises:
            MissingMesh: it is not found, or cannot be read.
        """
        use = (shape.url, shape.scale, shape.collides)
        if use not in self._names:
            try:
                self._names[use] = self._load(shape)
            except MissingMesh as error:
                self._names[use] = error
        name = self._names[use]
        if isinstance(name, MissingMesh):
            raise name
        return name

    def _load(self, shape: Shape) -> str:
        path = self._find(shape.url)
        if path is None:
            raise MissingMesh(f'mesh {shape.url} not found')
        try:
            mesh = load_mesh(path, None if shape.collides else PICTURE_FACES)
        except (OSError, ValueError) as error:
            if not shape.collides:
                LOGGER.warning('description: visual mesh left out: %s', error)
            raise MissingMesh(str(error)) from None
        name = f'mesh_{len(self._names)}'
        self._spec.add_mesh(
            name=name,
            uservert=(mesh.vertices * np.array(shape.scale, np.float32)).flatten(),
            # A mirror image is inside out unless its triangles turn the other way.
            userface=(mesh.faces[:, ::-1] if np.prod(shape.scale) < 0.0 else mesh.faces).flatten(),
            # Masses are the URDF's; computed from its volume, an open surface is an error.
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        return name


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
            geom.group = VISUAL_GROUP


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
