# SPDX-License-Identifier: Apache-2.0
"""Shapes of a URDF: what is drawn, in which colour, and what collides."""

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import replace
import xml.etree.ElementTree as ElementTree

import numpy as np
from wasd_core.rotations import Origin
from wasd_core.rotations import rpy_matrix

from robot_description.urdf_numbers import parse_numbers
from robot_description.urdf_numbers import read_numbers

# Attributes that give a primitive's size, in URDF's order, and how many numbers they are.
SIZES = {
    'box': (('size',), 3),
    'cylinder': (('radius', 'length'), 2),
    'sphere': (('radius',), 1),
    'mesh': ((), 0),
}
Colour = tuple[float, ...]
# Of what has no colour, or one that is none.
GREY = (0.7, 0.7, 0.7, 1.0)


@dataclass(frozen=True)
class Shape:
    """
    What is drawn or what collides: kind, size in URDF's order [m], pose in its link.

    A mesh has no size but a URL and a scale along x, y and z. What is drawn has a colour: red,
    green, blue, opacity, each from 0 to 1.
    """

    kind: str
    size: tuple[float, ...]
    pose: Origin
    collides: bool
    rgba: Colour = GREY
    url: str = ''
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


def shape_tags(link: ElementTree.Element) -> list[ElementTree.Element]:
    """Return the `visual` and `collision` tags of a link that have a geometry of URDF's."""
    return [
        tag
        for tag in link
        if tag.tag in ('visual', 'collision')
        and any(tag.find(f'geometry/{kind}') is not None for kind in SIZES)
    ]


def read_shape(tag: ElementTree.Element, colours: Mapping[str, Colour], where: str) -> Shape:
    """
    Return the shape of a tag that `shape_tags` gave; `colours` are those of `read_colours`.

    Raises:
        DescriptionError: a size or scale that is none.
    """
    kind, geometry = next(
        (kind, found) for kind in SIZES if (found := tag.find(f'geometry/{kind}')) is not None
    )
    attributes, count = SIZES[kind]
    text = ' '.join(geometry.get(attribute, '') for attribute in attributes)
    size = tuple(parse_numbers(text, count, f'{where}: {kind}').tolist())
    shape = Shape(
        kind, size, read_origin(tag, where), tag.tag == 'collision', _shape_colour(tag, colours)
    )
    if kind != 'mesh':
        return shape
    scale = geometry.get('scale', '1')
    count = 1 if len(scale.split()) == 1 else 3
    x, y, z = np.broadcast_to(parse_numbers(scale, count, f'{where}: scale'), 3).tolist()
    return replace(shape, url=geometry.get('filename', ''), scale=(x, y, z))


def read_colours(tree: ElementTree.Element) -> dict[str, Colour]:
    """Return the colours by the names of the materials that define them, in a link or beside."""
    return {
        material.get('name', ''): _read_colour(colour)
        for element in tree
        if element.tag in ('link', 'material')  # a gazebo tag's material is another thing
        for material in element.iter('material')
        if (colour := material.find('color')) is not None
    }


def _shape_colour(shape: ElementTree.Element, colours: Mapping[str, Colour]) -> Colour:
    """Return the first colour of a shape, of several; a texture alone counts as grey."""
    for material in shape.findall('material'):
        colour = material.find('color')
        if colour is not None:
            return _read_colour(colour)
        if material.get('name', '') in colours:
            return colours[material.get('name', '')]
    return GREY


def _read_colour(tag: ElementTree.Element) -> Colour:
    try:
        numbers = tuple(float(number) for number in tag.get('rgba', '').split())
    except ValueError:
        return GREY
    return numbers if len(numbers) == 4 and all(0.0 <= n <= 1.0 for n in numbers) else GREY


def read_origin(tag: ElementTree.Element | None, where: str) -> Origin:
    """
    Return the pose in the `origin` of a tag, if there is one.

    Raises:
        DescriptionError: it has other than three numbers each.
    """
    origin = tag.find('origin') if tag is not None else None
    roll, pitch, yaw = read_numbers(origin, 'rpy', '0 0 0', where).tolist()
    position = read_numbers(origin, 'xyz', '0 0 0', where)
    return Origin(position, rpy_matrix(roll, pitch, yaw), (roll, pitch, yaw))
