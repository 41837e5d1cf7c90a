# SPDX-License-Identifier: Apache-2.0
"""Mesh files as triangles: read with trimesh, kept in the user's cache."""

import contextlib
import hashlib
import os
from pathlib import Path
import tempfile
from typing import NamedTuple
import zipfile

import numpy as np

from robot_description.mesh_axes import to_metres_z_up

# Raise it when what is cached changes.
CACHE_VERSION = 2
# The largest mesh in example-robot-data, the Go1's trunk, has 29 MB.
LARGEST_FILE = 200_000_000


class Mesh(NamedTuple):
    """Triangles of a mesh as its file has them: vertices (n, 3) [m], z up, and faces (m, 3)."""

    vertices: np.ndarray
    faces: np.ndarray


def load_mesh(path: Path) -> Mesh:
    """
    Return the triangles of a mesh file in metres, z up, from the cache when it is there.

    What its nodes place and scale is where it belongs. Several processes may share the cache.

    Raises:
        ValueError: the file cannot be read as a mesh.
    """
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise ValueError(f'{path}: {size / 1e6:.0f} MB, at most {LARGEST_FILE / 1e6:.0f} are read')
    cached = _cache_folder() / f'{_digest(path)}.npz'
    mesh = _read_cache(cached)
    if mesh is None:
        mesh = _read_mesh(path)
        _write_cache(cached, mesh)
    return mesh


def _read_mesh(path: Path) -> Mesh:
    # Here, because it takes longer to load than everything else, and a cached mesh needs it not.
    import trimesh

    try:
        merged = trimesh.load_scene(path).to_mesh()
        axes = to_metres_z_up(path)
    except Exception as error:  # every decoder raises its own
        raise ValueError(f'{path}: {" ".join(str(error).split())}') from None
    if not len(merged.faces):
        raise ValueError(f'{path}: no triangles in it')
    vertices = np.asarray(merged.vertices) @ axes.T
    if not np.isfinite(vertices).all():
        raise ValueError(f'{path}: some of its points are no numbers')
    return Mesh(vertices.astype(np.float32), np.asarray(merged.faces, np.int32))


def _digest(path: Path) -> str:
    kind = f'{CACHE_VERSION}{path.suffix.lower()}'.encode()
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
