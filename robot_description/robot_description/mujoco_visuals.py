# SPDX-License-Identifier: Apache-2.0
"""What is drawn of a robot in MuJoCo: meshes where they are found, its primitives where not."""

from collections.abc import Callable
import logging
from pathlib import Path

import mujoco
import numpy as np

from robot_description.errors import DescriptionError
from robot_description.meshes import load_mesh
from robot_description.mujoco_urdf import MeshUse

# Without a handler Python writes warnings to standard error, a line each.
LOGGER = logging.getLogger(__name__)
VISUAL_GROUP = 2
COLLISION_GROUP = 3

# Returns the file that a mesh URL means, or None.
FindMesh = Callable[[str], Path | None]


def find_nothing(_: str) -> Path | None:
    """Find no mesh: primitives only."""
    return None


def sort_geoms(spec: mujoco.MjSpec) -> None:
    """Put what is drawn and what collides into groups of their own; neither weighs anything."""
    for geom in spec.geoms:
        geom.mass = 0.0  # else MuJoCo weighs the shapes of links without an inertial
        collides = bool(geom.contype or geom.conaffinity)
        geom.group = COLLISION_GROUP if collides else VISUAL_GROUP


def strip_visuals(spec: mujoco.MjSpec) -> None:
    """Leave only what collides: a run that nobody watches is faster without the rest."""
    for geom in list(spec.geoms):
        if geom.group == VISUAL_GROUP:
            spec.delete(geom)
    used = {geom.meshname for geom in spec.geoms}
    for mesh in list(spec.meshes):
        if mesh.name not in used:
            spec.delete(mesh)


def fill_meshes(spec: mujoco.MjSpec, meshes: dict[str, MeshUse], find: FindMesh) -> None:
    """
    Load the meshes that the specification has under the names of `meshes`.

    Links whose visual mesh is missing show what they collide with instead.

    Raises:
        DescriptionError: a mesh that something collides with is missing or cannot be read.
    """
    for target in list(spec.meshes):
        url, scale = meshes[target.name]
        path = find(url)
        if path is None:
            _do_without(spec, target, f'mesh {url} not found')
            continue
        try:
            mesh = load_mesh(path)
        except (OSError, ValueError) as error:
            _do_without(spec, target, str(error))
            LOGGER.warning('description: visual mesh left out: %s', error)
            continue
        target.file = ''
        target.uservert = (mesh.vertices * np.array(scale, np.float32)).flatten()
        # A mirror image is inside out unless its triangles turn the other way.
        faces = mesh.faces[:, ::-1] if np.prod(scale) < 0.0 else mesh.faces
        target.userface = faces.flatten()
        # Masses are the URDF's; computed from its volume, an open surface is an error.
        target.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL


def _do_without(spec: mujoco.MjSpec, mesh: mujoco.MjsMesh, why: str) -> None:
    """Show what the links of a missing visual mesh collide with."""
    for geom in [geom for geom in spec.geoms if geom.meshname == mesh.name]:
        if geom.group == COLLISION_GROUP:
            raise DescriptionError(f'link {geom.parent.name!r} collides with what is not: {why}')
        for other in geom.parent.geoms:
            if other.group == COLLISION_GROUP:
                other.group = VISUAL_GROUP
        spec.delete(geom)
    spec.delete(mesh)
