# SPDX-License-Identifier: Apache-2.0
"""Reads the triangles of a Collada file, without materials, in metres and with z up."""

from collections.abc import Iterator
import io
from pathlib import Path
from typing import Any
import xml.etree.ElementTree as ElementTree

# Not trimesh, which reads Collada too: it takes three times as long to load, and leaves unit and
# up axis to others.
import collada
import numpy as np

# Rotations to x ahead, z up; COLLADA 1.4.1 says where `right` and `in` are for each up axis.
UP_AXES = {
    'X_UP': np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
    'Y_UP': np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    'Z_UP': np.eye(3),
}
IGNORED = [collada.common.DaeError]
MATERIALS = ('bind_material', 'library_materials', 'library_effects', 'library_images')


def read_collada(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """
    Return vertices (n, 3) [m] and faces (m, 3) of all that the file's scene shows.

    Raises:
        Exception: whatever pycollada does.
    """
    document = collada.Collada(str(path), ignore=IGNORED)
    if document.errors:  # of materials mostly, with which pycollada drops what they are on
        document = collada.Collada(io.BytesIO(_without_materials(path)), ignore=IGNORED)
    if document.scene is None:
        raise ValueError('no scene in it')
    vertices, faces, count = [np.zeros((0, 3))], [np.zeros((0, 3), int)], 0
    for points, corners in _parts(document.scene):
        vertices.append(points)
        faces.append(corners + count)
        count += len(points)
    return np.concatenate(vertices) @ _to_metres_z_up(document.assetInfo).T, np.concatenate(faces)


def _without_materials(path: Path) -> bytes:
    tree = ElementTree.parse(path)
    for parent in list(tree.iter()):
        for child in list(parent):
            if child.tag.rpartition('}')[2] in MATERIALS:
                parent.remove(child)
    return ElementTree.tostring(tree.getroot())


def _parts(scene: Any) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield vertices and faces of each part where its nodes place it."""
    for geometry in scene.objects('geometry'):
        mirrored = np.linalg.det(geometry.matrix[:3, :3]) < 0.0
        for part in geometry.primitives():
            if hasattr(part, 'triangleset'):  # polygons
                part = part.triangleset()
            if not isinstance(part, collada.triangleset.BoundTriangleSet):  # lines
                continue
            # Each part has all vertices of its geometry, also those of the other materials.
            used, corners = np.unique(part.vertex_index, return_inverse=True)
            faces = corners.reshape(-1, 3)
            yield np.asarray(part.vertex, float)[used], faces[:, ::-1] if mirrored else faces


def _to_metres_z_up(asset: Any) -> np.ndarray:
    """
    Return the matrix (3, 3) from the file's coordinates to metres with z up.

    MeshLab and pycollada write `Y_UP` whatever the data are, as in 31 meshes of
    example-robot-data, the Go1's trunk among them: theirs stay as they are, as do those of files
    that say nothing. RViz shows all files so.
    """
    said = {} if asset.xmlnode is None else {
        child.tag.rpartition('}')[2]: (child.text or '').strip() for child in asset.xmlnode
    }  # fmt: skip
    tools = [str(contributor.authoring_tool or '') for contributor in asset.contributors]
    # pycollada names no tool; it gives the time in microseconds and without a zone.
    is_pycollada = not any(tools) and len(said.get('created', '').partition('.')[2]) == 6
    means_nothing = is_pycollada or any('MeshLab' in tool for tool in tools)
    up = 'Z_UP' if means_nothing else said.get('up_axis', 'Z_UP').upper()
    unit = 1.0 if asset.unitmeter is None else float(asset.unitmeter)
    return unit * UP_AXES.get(up, UP_AXES['Z_UP'])
