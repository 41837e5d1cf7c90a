# SPDX-License-Identifier: Apache-2.0
"""Shapes of a URDF: what is drawn and what collides."""

from dataclasses import dataclass
import xml.etree.ElementTree as ElementTree

import numpy as np

from robot_description.pose import Pose
from robot_description.pose import rpy_matrix
from robot_description.urdf_numbers import parse_numbers
from robot_description.urdf_numbers import read_numbers

# Attributes that give a primitive's size, in URDF's order, and how many numbers they are.
SIZES = {
    'box': (('size',), 3),
    'cylinder': (('radius', 'length'), 2),
    'sphere': (('radius',), 1),
    'mesh': ((), 0),
}


@dataclass(frozen=True)
class Shape:
    """
    What is drawn or what collides: kind, size in URDF's order [m], pose in its link.

    A mesh has no size but a URL and a scale along x, y and z.
    """

    kind: str
    size: tuple[float, ...]
    pose: Pose
    url: str = ''
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


def shape_tags(link: ElementTree.Element, tag: str) -> list[ElementTree.Element]:
    """Return the `visual` or `collision` tags of a link that have a geometry of URDF's."""
    return [
        shape
        for shape in link.findall(tag)
        if any(shape.find(f'geometry/{kind}') is not None for kind in SIZES)
    ]


def read_shape(tag: ElementTree.Element, where: str) -> Shape:
    """
    Return the shape of a `visual` or `collision` tag that `shape_tags` gave.

    Raises:
        DescriptionError: a size or scale that is none.
    """
    kind, geometry = next(
        (kind, found) for kind in SIZES if (found := tag.find(f'geometry/{kind}')) is not None
    )
    attributes, count = SIZES[kind]
    text = ' '.join(geometry.get(attribute, '') for attribute in attributes)
    size = tuple(parse_numbers(text, count, f'{where}: {kind}').tolist())
    pose = read_origin(tag, where)
    if kind != 'mesh':
        return Shape(kind, size, pose)
    scale = geometry.get('scale', '1')
    count = 1 if len(scale.split()) == 1 else 3
    x, y, z = np.broadcast_to(parse_numbers(scale, count, f'{where}: scale'), 3).tolist()
    return Shape(kind, size, pose, geometry.get('filename', ''), (x, y, z))


def read_origin(tag: ElementTree.Element, where: str) -> Pose:
    """
    Return the pose in the `origin` of a tag.

    Raises:
        DescriptionError: it has other than three numbers each.
    """
    origin = tag.find('origin')
    roll, pitch, yaw = read_numbers(origin, 'rpy', '0 0 0', where)
    return Pose(read_numbers(origin, 'xyz', '0 0 0', where), rpy_matrix(roll, pitch, yaw))
