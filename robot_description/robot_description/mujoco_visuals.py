# SPDX-License-Identifier: Apache-2.0
"""What is drawn of a robot in MuJoCo: meshes where they are found, its primitives where not."""

from collections.abc import Callable
from pathlib import Path
import xml.etree.ElementTree as ElementTree

import mujoco

from robot_description.meshes import load_mesh

VISUAL_GROUP = 2
COLLISION_GROUP = 3

# Returns the file that a mesh URL means, or None.
FindMesh = Callable[[str], Path | None]


def rename_meshes(urdf: str) -> tuple[str, dict[str, str]]:
    """
    Return the URDF with its visual meshes under plain names, and the URL of each name.

    MuJoCo reads neither `package://` nor Collada; it only has to keep the names apart.
    """
    tree = ElementTree.fromstring(urdf)
    names: dict[str, str] = {}
    for tag in tree.iterfind('.//visual/geometry/mesh'):
        name = names.setdefault(tag.get('filename', ''), f'visual_{len(names)}')
        tag.set('filename', f'{name}.obj')
    urls = {name: url for url, name in names.items()}
    return ElementTree.tostring(tree, encoding='unicode'), urls


def sort_geoms(spec: mujoco.MjSpec) -> None:
    """Put what is drawn and what collides into groups of their own."""
    for geom in spec.geoms:
        collides = bool(geom.contype or geom.conaffinity)
        geom.group = COLLISION_GROUP if collides else VISUAL_GROUP


def strip_visuals(spec: mujoco.MjSpec) -> None:
    """Leave only what collides: a run that nobody watches is faster without the rest."""
    for geom in list(spec.geoms):
        if geom.group == VISUAL_GROUP:
            spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)


def fill_meshes(spec: mujoco.MjSpec, urls: dict[str, str], find: FindMesh) -> list[str]:
    """
    Load the meshes under the names of `urls`; return the URLs that could not be loaded.

    Links whose mesh is missing show what they collide with instead.
    """
    missing = []
    for name, url in urls.items():
        path = find(url)
        try:
            mesh = load_mesh(path) if path is not None else None
        except ValueError:
            mesh = None
        if mesh is None:
            missing.append(url)
            _show_primitives(spec, name)
            continue
        target = spec.mesh(name)
        target.file = ''
        target.uservert = mesh.vertices.flatten()
        target.userface = mesh.faces.flatten()
        # A drawing has no inertia; computed from its volume, an open surface is an error.
        target.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    return missing


def _show_primitives(spec: mujoco.MjSpec, mesh: str) -> None:
    for geom in list(spec.geoms):
        if geom.meshname == mesh:
            for other in geom.parent.geoms:
                if other.group == COLLISION_GROUP:
                    other.group = VISUAL_GROUP
            spec.delete(geom)
    spec.delete(spec.mesh(mesh))
