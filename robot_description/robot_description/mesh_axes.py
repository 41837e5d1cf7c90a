# SPDX-License-Identifier: Apache-2.0
"""What a mesh file says of its unit and its axes, which its reader leaves to others."""

import json
from pathlib import Path
import struct
import xml.etree.ElementTree as ElementTree

import numpy as np

# Rotations to x ahead, z up; COLLADA 1.4.1 says where `right` and `in` are for each up axis.
Z_UP = np.eye(3)
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
X_UP = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
UP_AXES = {'X_UP': X_UP, 'Y_UP': Y_UP, 'Z_UP': Z_UP}
GLB_MAGIC = b'glTF'


def to_metres_z_up(path: Path) -> np.ndarray:
    """
    Return the matrix (3, 3) that takes a file's coordinates to metres with z up.

    Collada says both. glTF is in metres with y up. Other formats say nothing: they are taken as
    they are. MeshLab and pycollada write `Y_UP` whatever the data are (as in 31 meshes of
    example-robot-data, the Go1's trunk among them), trimesh does so in glTF: theirs stays as it
    is, which is also what RViz shows.
    """
    suffix = path.suffix.lower()
    if suffix == '.dae':
        return _collada(path)
    if suffix in ('.glb', '.gltf') and 'trimesh' not in _gltf_generator(path):
        return Y_UP
    return np.eye(3)


def _collada(path: Path) -> np.ndarray:
    unit, up, tool, created = 1.0, 'Y_UP', '', ''  # the defaults of COLLADA
    for _, element in ElementTree.iterparse(path):
        tag = element.tag.rpartition('}')[2]
        text = (element.text or '').strip()
        if tag == 'unit':
            unit = float(element.get('meter', '1'))
        elif tag == 'up_axis':
            up = text.upper()
        elif tag == 'authoring_tool':
            tool = text
        elif tag == 'created':
            created = text
        elif tag == 'asset':
            break
        elif tag in ('geometry', 'library_geometries', 'scene'):
            up = 'Z_UP'  # no asset before them: nothing is said
            break
    # pycollada names no tool; it writes Python's time with microseconds and without a zone.
    is_pycollada = not tool and len(created.partition('.')[2]) == 6
    rotation = Z_UP if 'MeshLab' in tool or is_pycollada else UP_AXES.get(up, Z_UP)
    return unit * rotation


def _gltf_generator(path: Path) -> str:
    """Return the program that wrote a glTF file."""
    data = path.read_bytes()
    if data[:4] == GLB_MAGIC:
        (length,) = struct.unpack_from('<I', data, 12)
        data = data[20 : 20 + length]
    return str(json.loads(data).get('asset', {}).get('generator', ''))
