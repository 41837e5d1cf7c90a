# SPDX-License-Identifier: Apache-2.0
"""Mesh files as triangles: read with trimesh, kept in the user's cache."""

import hashlib
import os
from pathlib import Path
import tempfile
from typing import NamedTuple
import zipfile

import numpy as np

# Raise it when what is cached changes.
CACHE_VERSION = 1


class Mesh(NamedTuple):
    """Triangles of a mesh in its link's frame: vertices (n, 3) [m], faces (m, 3)."""

    vertices: np.ndarray
    faces: np.ndarray


def load_mesh(path: Path) -> Mesh:
    """
    Return the triangles of a mesh file in metres, z up, from the cache when it is there.

    Raises:
        ValueError: the file cannot be read as a mesh.
    """
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
        scene = trimesh.load_scene(path)
        merged = scene.to_mesh()
    except Exception as error:  # every decoder raises its own
        raise ValueError(f'{path}: {" ".join(str(error).split())}') from None
    if not len(merged.faces):
        raise ValueError(f'{path}: no triangles in it')
    return Mesh(np.asarray(merged.vertices, np.float32), np.asarray(merged.faces, np.int32))


def _digest(path: Path) -> str:
    return hashlib.sha256(b'%d' % CACHE_VERSION + path.read_bytes()).hexdigest()[:32]


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
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, suffix='.npz')
        with os.fdopen(handle, 'wb') as file:
            np.savez(file, vertices=mesh.vertices, faces=mesh.faces)
        os.replace(name, path)
    except OSError:
        return
