# SPDX-License-Identifier: Apache-2.0
"""Mesh files as triangles: read once, kept in the user's cache."""

import codecs
from collections.abc import Iterator
import contextlib
import functools
from functools import lru_cache
import hashlib
import io
import json
import os
from pathlib import Path
import re
import struct
from typing import Any, NamedTuple, TypeVar
import xml.etree.ElementTree as ElementTree
import zipfile

import numpy as np
from wasd_core.cache import cache_folder
from wasd_core.errors import one_line
from wasd_core.output_file import OutputError, OutputFile
from wasd_core.safe_files import read_file

from robot_description.meshes.files import EXTENSIONS
from robot_description.robot import Robot, Shape
from robot_description.xacro.source import IN_ITS_PLACE, STL_HEADER, STL_TRIANGLE

# Raise it when what is cached changes.
CACHE_VERSION = 5
# Points nearer than this are one point of a surface that is thinned [decimals of a metre].
WELD_DECIMALS = 6
# How carefully a surface is thinned, 0 (slow) to 10: from 4 on the letters on a Go2 fall apart.
HASTE = 3.0
# So many meshes are kept in memory, as many as a humanoid with hands has: what was opened to be
# measured is simulated next.
MOST_KEPT = 64
# Of so many it is kept in memory how large they are: most are drawn and collide.
MOST_MEASURED = 1024
# The largest mesh in example-robot-data, the Go1's trunk, has 29 MB. Of a million triangles, 50 MB
# as an STL, readers take 0.8 GB of memory.
LARGEST_FILE = 52_000_000
# A point farther from the origin than this is a mistake, not a mesh [m].
FARTHEST = 1e9
# glTF is in metres with y up, except what trimesh wrote. Other formats, but Collada, do not say
# what they are in: they are taken as they are.
GLTF = ('.glb', '.gltf')
# Readers of these take textures, too, unless they are told not to.
TEXTURED = ('.obj', '.ply', *GLTF)
# As many as nodes of a COLLADA file may place.
MOST_PARTS = 10_000
GLB_MAGIC = b'glTF'
# How files of a format begin, whatever they are called.
LONGEST_HEAD = 512
BEGINNINGS = {GLB_MAGIC: '.glb', b'ply\n': '.ply', b'ply\r': '.ply', b'<?xml': '.dae'}
# An STL of text says `facet` within so many bytes.
STL_WORDS = 2000
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


class Extent(NamedTuple):
    """The box around a mesh, low and high corner (3,) [m], and the area of its surface [m2]."""

    low: np.ndarray
    high: np.ndarray
    area: np.ndarray


Cached = TypeVar('Cached', Mesh, Extent)


class Detail(NamedTuple):
    """
    How many triangles a surface keeps: a share of its own, and at least and at most so many.

    Large plain shapes lose less by that than small ones that are full of edges.
    """

    share: float
    least: int
    most: int

    def of(self, count: int) -> int:
        """Return how many are kept of `count`."""
        return min(count, self.most, max(self.least, round(self.share * count)))


def load_mesh(path: Path, detail: Detail | None = None) -> Mesh:
    """
    Return the triangles of a mesh file in metres, z up, from the cache when it is there.

    What its nodes place and scale is where it belongs. With a `detail` its surface is thinned to
    about so many triangles. Several processes may share the cache.

    Raises:
        OSError, ValueError: the file cannot be read as a mesh.
    """
    _check_beginning(path)
    cached = _cache_file(_digest(path, detail))
    mesh = _read_cache(cached, Mesh)
    if mesh is None:
        mesh = _decoded(path, _digest(path))
        if detail is not None and detail.of(len(mesh.faces)) < len(mesh.faces):
            mesh = _thin(mesh, detail.of(len(mesh.faces)))
        _write_cache(cached, mesh)
    return mesh


def extent(path: Path) -> Extent:
    """
    Return how large a mesh is; of a file that has not changed from the cache.

    Raises:
        OSError, ValueError: the file cannot be read as a mesh.
    """
    status = path.stat()
    key = f'{CACHE_VERSION} {path.absolute()} {status.st_mtime_ns} {status.st_size}'
    cached = _cache_file(hashlib.sha256(os.fsencode(key)).hexdigest()[:32])
    return _extent(path, key, cached)


@lru_cache(maxsize=MOST_MEASURED)
def _extent(path: Path, _: str, cached: Path | None) -> Extent:
    """Return how large a mesh is; the second argument tells its contents apart."""
    _check_beginning(path)
    found = _read_cache(cached, Extent)
    if found is None:
        vertices, faces = _decoded(path, _digest(path))
        a, b, c = (vertices[faces[:, corner]].astype(float) for corner in range(3))
        area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
        found = Extent(vertices.min(axis=0), vertices.max(axis=0), area)
        _write_cache(cached, found)
    return found


@lru_cache(maxsize=MOST_KEPT)
def _decoded(path: Path, _: str) -> Mesh:
    """Return a file's triangles; the other argument tells its contents apart."""
    return _read_mesh(path)


def mesh_points(robot: Robot, shape: Shape) -> np.ndarray | None:
    """Return the points (n, 3) [m] of a mesh in its frame, scaled; None of one not to be had."""
    path = robot.mesh_files.get(shape.url)
    if path is None:
        return None
    try:
        status = path.stat()
        vertices = _vertices(path, status.st_mtime_ns, status.st_size)
    except (OSError, ValueError):
        return None
    points: np.ndarray = vertices.astype(float) * np.array(shape.scale)
    return points


@lru_cache(maxsize=MOST_KEPT)
def _vertices(path: Path, _mtime_ns: int, _size: int) -> np.ndarray:
    """Return a file's points (n, 3) [m]; the other arguments tell its contents apart."""
    return load_mesh(path).vertices


def _check_beginning(path: Path) -> None:
    """Refuse what no reader need be asked about."""
    size = path.stat().st_size
    if size > LARGEST_FILE:
        most = f'{LARGEST_FILE / 1e6:.0f}'
        raise ValueError(f'{path}: {size / 1e6:.0f} MB, at most {most} are read: reduce it')
    if not size:
        raise ValueError(f'{path}: is empty')
    with open(path, 'rb') as file:
        head = file.read(LONGEST_HEAD).lstrip()
    for pattern, what, cure in IN_ITS_PLACE:
        if re.match(pattern, head):
            raise ValueError(f'{path}: {what}; {cure}')
    for beginning, suffix in BEGINNINGS.items():
        if head.lower().startswith(beginning.lower()) and path.suffix.lower() != suffix:
            raise ValueError(f'{path}: is a {suffix} file by its content: rename it')


class _Beside:
    """The files that a mesh names, from its own folder, with it no more than LARGEST_FILE."""

    def __init__(self, path: Path) -> None:
        self._folder = path.resolve().parent  # of a link, as colcon makes them, its file's
        self._left = LARGEST_FILE - path.stat().st_size

    def __getitem__(self, name: str) -> bytes:
        for candidate in (name.strip().lstrip('/'), Path(name).name):
            file = (self._folder / candidate).resolve()
            if file.is_relative_to(self._folder) and file.exists():
                data = read_file(file, self._left)
                self._left -= len(data)
                return data
        raise ValueError(f'{name!r} is not in {self._folder}: put it there')


@np.errstate(all='ignore')  # readers compute with any numbers, which are looked at below
def _read_mesh(path: Path) -> Mesh:
    suffix = path.suffix.lower()
    if suffix not in EXTENSIONS:
        raise ValueError(f'{path}: is no mesh by its name: export it as {", ".join(EXTENSIONS)}')
    try:
        # Here, because readers take longer to load than a cached mesh.
        if suffix == '.dae':
            vertices, faces = _read_collada(path)
        else:
            import trimesh

            source = _whole_stl(path) if suffix == '.stl' else path
            # Textures would be read, and laid side by side in one picture.
            options: dict[str, Any] = {'skip_materials': True} if suffix in TEXTURED else {}
            options |= {'file_type': suffix, 'resolver': _Beside(path)}
            merged = trimesh.load_scene(source, **options).to_mesh()
            vertices, faces = np.asarray(merged.vertices), np.asarray(merged.faces)
            if suffix in GLTF and 'trimesh' not in _gltf_generator(path):
                vertices = vertices @ Y_TO_Z_UP.T
    except Exception as error:  # every decoder raises its own
        raise ValueError(f'{path}: cannot be read as a mesh: {one_line(error)}') from None
    if not len(faces):
        raise ValueError(f'{path}: no triangles in it')
    if not (np.abs(vertices) < FARTHEST).all():
        raise ValueError(f'{path}: some of its points are not numbers, or no lengths')
    return Mesh(vertices.astype(np.float32), faces.astype(np.int32))


def _thin(mesh: Mesh, most_faces: int) -> Mesh:
    """Merge edges where it is seen least, by quadric error (Garland and Heckbert, 1997)."""
    import fast_simplification

    # Readers leave a point for each face that it is in: unless they are one, faces part there.
    points, index = np.unique(mesh.vertices.round(WELD_DECIMALS), axis=0, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces].astype(np.int32)
    thinned = fast_simplification.simplify(points, faces, target_count=most_faces, agg=HASTE)
    return Mesh(thinned[0].astype(np.float32), thinned[1].astype(np.int32))


def _whole_stl(path: Path) -> io.BytesIO:
    """Return an STL without the bytes behind its end; refuse one that is too short."""
    data = path.read_bytes().removeprefix(codecs.BOM_UTF8)
    if data.lstrip()[:5].lower() == b'solid' and b'facet' in data[:STL_WORDS].lower():
        if b'endsolid' not in data.lower():
            raise ValueError('it is cut off: there is no endsolid')
        return io.BytesIO(data)
    count = int.from_bytes(data[STL_HEADER - 4 : STL_HEADER], 'little')
    wanted = STL_HEADER + count * STL_TRIANGLE
    if len(data) < wanted:
        raise ValueError(f'it is cut off: {len(data)} bytes of {wanted}')
    return io.BytesIO(data[:wanted])


def _gltf_generator(path: Path) -> str:
    """Return the program that wrote a glTF file."""
    data = path.read_bytes()
    if data[:4] == GLB_MAGIC:
        (length,) = struct.unpack_from('<I', data, 12)
        data = data[20 : 20 + length]
    return str(json.loads(data).get('asset', {}).get('generator', ''))


def _digest(path: Path, detail: Detail | None = None) -> str:
    kind = f'{CACHE_VERSION}{path.suffix.lower()}{detail or ""}'.encode()
    return hashlib.sha256(kind + path.read_bytes()).hexdigest()[:32]


def _cache_file(name: str) -> Path | None:
    folder = cache_folder('meshes')
    return folder and folder / f'{name}.npz'


def _read_cache(path: Path | None, kind: type[Cached]) -> Cached | None:
    if path is None:
        return None
    try:
        with np.load(path) as arrays:
            return kind(**{name: arrays[name] for name in kind._fields})
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile):
        return None


def _write_cache(path: Path | None, what: Mesh | Extent) -> None:
    """Write whole or not at all; a cache that cannot be written is none."""
    if path is None:
        return
    data = io.BytesIO()
    np.savez(data, **what._asdict())
    with contextlib.suppress(OutputError):
        OutputFile(path, '').write(data.getvalue())


def _read_collada(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """
    Return vertices (n, 3) [m] and faces (m, 3) of all that the file's scene shows.

    Raises:
        Exception: whatever pycollada does.
    """
    # Not trimesh, which reads Collada too: it takes three times as long to load, and leaves unit
    # and up axis to others.
    import collada

    document = None
    read = functools.partial(collada.Collada, ignore=[collada.common.DaeError])
    # Without comments and processing instructions, which may stand anywhere: to pycollada they are
    # elements among the others, and numbers end where one begins.
    root = ElementTree.fromstring(path.read_bytes())
    _leave_positions(root)
    # Of materials mostly, with which pycollada drops what they are on; 0.7.2 does not ignore it.
    with contextlib.suppress(collada.common.DaeError):
        document = read(io.BytesIO(ElementTree.tostring(root)))
    if document is None or document.errors:
        _remove_materials(root)
        document = read(io.BytesIO(ElementTree.tostring(root)))
    if document.scene is None:
        raise ValueError('no scene in it')
    vertices, faces, count = [np.zeros((0, 3))], [np.zeros((0, 3), int)], 0
    for points, corners in _parts(document.scene):
        vertices.append(points)
        faces.append(corners + count)
        count += len(points)
    return np.concatenate(vertices) @ _to_metres_z_up(document.assetInfo).T, np.concatenate(faces)


def _leave_positions(root: ElementTree.Element) -> None:
    """Empty normals and texture coordinates: pycollada reads numbers of them for half its time."""
    for mesh in root.iterfind('.//{*}mesh'):
        places = set()
        for part in mesh.iterfind('.//{*}input'):
            if part.get('semantic') in ('POSITION', 'VERTEX'):
                places.add(part.get('source'))
            else:
                part.set('semantic', 'COLOR')  # of which it looks at nothing
        for source in mesh.iterfind('{*}source'):
            for numbers in source.iterfind('{*}float_array'):
                if f'#{source.get("id")}' not in places:
                    numbers.text = ''


def _remove_materials(root: ElementTree.Element) -> None:
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag.rpartition('}')[2] in MATERIALS:
                parent.remove(child)


def _parts(scene: Any) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield vertices and faces of each part where its nodes place it."""
    from collada.triangleset import BoundTriangleSet

    for number, geometry in enumerate(scene.objects('geometry')):
        if number == MOST_PARTS:
            raise ValueError(f'more than {MOST_PARTS} parts: nodes within nodes repeat them')
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
