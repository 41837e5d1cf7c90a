# SPDX-License-Identifier: Apache-2.0
"""Mesh files as triangles: read once, kept in the user's cache."""

from collections.abc import Iterator
import contextlib
import hashlib
import io
import json
import os
from pathlib import Path
import struct
import tempfile
from typing import Any, NamedTuple
import xml.etree.ElementTree as ElementTree
import zipfile

import numpy as np
from wasd_core.errors import one_line

from robot_description.robot import Robot
from robot_description.robot import Shape

# Raise it when what is cached changes.
CACHE_VERSION = 4
# Points nearer than this are one point of a surface that is thinned [decimals of a metre].
WELD_DECIMALS = 6
# How carefully a surface is thinned, 0 (slow) to 10: from 4 on the letters on a Go2 fall apart.
HASTE = 3.0
# The largest mesh in example-robot-data, the Go1's trunk, has 29 MB.
LARGEST_FILE = 200_000_000
# glTF is in metres with y up, except what trimesh wrote. Other formats, but Collada, do not say
# what they are in: they are taken as they are.
GLTF = ('.glb', '.gltf')
GLB_MAGIC = b'glTF'
Y_TO_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
# Rotations to x ahead, z up; COLLADA 1.4.1 says where `right` and `in` are for each up axis.
UP_AXES = {
    'X_UP': np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
    'Y_UP': np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    'Z_UP': np.eye(3),
}
MATERIALS = ('bind_material', 'library_materials', 'library_effects', 'library_images')


class Mesh(NamedTuple):
    """Triangles of a mesh as its file has them: vertices (n, 3) [m], z up, and faces (m, 3)."""

    vertices: np.ndarray
    faces: np.ndarray


def load_mesh(path: Path, most_faces: int | None = None) -> Mesh:
    """
    Return the triangles of a mesh file in metres, z up, from the cache when it is there.

    What its nodes place and scale is where it belongs. A surface of more than `most_faces`
    triangles is thinned to about so many. Several processes may share the cache.

    Raises:
        ValueError: the file cannot be read as a mesh.
    """
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise ValueError(f'{path}: {size / 1e6:.0f} MB, at most {LARGEST_FILE / 1e6:.0f} are read')
    cached = _cache_folder() / f'{_digest(path, most_faces)}.npz'
    mesh = _read_cache(cached)
    if mesh is None:
        mesh = _read_mesh(path)
        if most_faces is not None and len(mesh.faces) > most_faces:
            mesh = _thin(mesh, most_faces)
        _write_cache(cached, mesh)
    return mesh


def mesh_points(robot: Robot, shape: Shape) -> np.ndarray | None:
    """Return the points (n, 3) [m] of a mesh in its frame, scaled; None of one not to be had."""
    path = robot.mesh_files.get(shape.url)
    try:
        mesh = load_mesh(path) if path is not None else None
    except (OSError, ValueError):
        return None
    return None if mesh is None else mesh.vertices.astype(float) * np.array(shape.scale)


def _read_mesh(path: Path) -> Mesh:
    suffix = path.suffix.lower()
    try:
        # Here, because readers take longer to load than a cached mesh.
        if suffix == '.dae':
            vertices, faces = _read_collada(path)
        else:
            import trimesh

            merged = trimesh.load_scene(path).to_mesh()
            vertices, faces = np.asarray(merged.vertices), np.asarray(merged.faces)
            if suffix in GLTF and 'trimesh' not in _gltf_generator(path):
                vertices = vertices @ Y_TO_Z_UP.T
    except Exception as error:  # every decoder raises its own
        raise ValueError(f'{path}: {one_line(error)}') from None
    if not len(faces):
        raise ValueError(f'{path}: no triangles in it')
    if not np.isfinite(vertices).all():
        raise ValueError(f'{path}: some of its points are no numbers')
    return Mesh(vertices.astype(np.float32), faces.astype(np.int32))


def _thin(mesh: Mesh, most_faces: int) -> Mesh:
    """Merge edges where it is seen least, by quadric error (Garland and Heckbert, 1997)."""
    import fast_simplification

    # Readers leave a point for each face that it is in: unless they are one, faces part there.
    points, index = np.unique(mesh.vertices.round(WELD_DECIMALS), axis=0, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces].astype(np.int32)
    thinned = fast_simplification.simplify(points, faces, target_count=most_faces, agg=HASTE)
    return Mesh(thinned[0].astype(np.float32), thinned[1].astype(np.int32))


def _gltf_generator(path: Path) -> str:
    """Return the program that wrote a glTF file."""
    data = path.read_bytes()
    if data[:4] == GLB_MAGIC:
        (length,) = struct.unpack_from('<I', data, 12)
        data = data[20 : 20 + length]
    return str(json.loads(data).get('asset', {}).get('generator', ''))


def _digest(path: Path, most_faces: int | None) -> str:
    kind = f'{CACHE_VERSION}{path.suffix.lower()}{most_faces or ""}'.encode()
    return hashlib.sha256(kind + path.read_bytes()).hexdigest()[:32]


def _cache_folder() -> Path:
    root = os.environ.get('XDG_CACHE_HOME') or os.path.join(os.path.expanduser('~'), '.cache')
    return Path(root) / 'wasd' / 'meshes'


def _read_cache(path: Path) -> Mesh | None:
    try:
        with np.load(path) as arrays:
            return Mesh(arrays['vertices'], arrays['faces'])
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile):
        return None


def _write_cache(path: Path, mesh: Mesh) -> None:
    """Write whole or not at all; a cache that cannot be written is none."""
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, suffix='.part')
        try:
            with os.fdopen(handle, 'wb') as file:
                np.savez(file, vertices=mesh.vertices, faces=mesh.faces)
            os.replace(name, path)
        except BaseException:
            os.unlink(name)
            raise


def _read_collada(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """
    Return vertices (n, 3) [m] and faces (m, 3) of all that the file's scene shows.

    Raises:
        Exception: whatever pycollada does.
    """
    # Not trimesh, which reads Collada too: it takes three times as long to load, and leaves unit
    # and up axis to others.
    import collada

    ignored = [collada.common.DaeError]
    document = collada.Collada(str(path), ignore=ignored)
    if document.errors:  # of materials mostly, with which pycollada drops what they are on
        document = collada.Collada(io.BytesIO(_without_materials(path)), ignore=ignored)
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
    from collada.triangleset import BoundTriangleSet

    for geometry in scene.objects('geometry'):
        mirrored = np.linalg.det(geometry.matrix[:3, :3]) < 0.0
        for part in geometry.primitives():
            if hasattr(part, 'triangleset'):  # polygons
                part = part.triangleset()
            if not isinstance(part, BoundTriangleSet):  # lines
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
