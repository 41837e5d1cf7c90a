# SPDX-License-Identifier: Apache-2.0
"""A URDF as MuJoCo's reader can take it: meshes under plain names, one plain colour a shape."""

from typing import NamedTuple
import xml.etree.ElementTree as ElementTree

from robot_description.mujoco_masses import mend_inertials
from robot_description.plain_urdf import plain_urdf
from robot_description.urdf import Robot
from robot_description.urdf_shapes import shape_tags

GREY = '0.7 0.7 0.7 1'


class MeshUse(NamedTuple):
    """A mesh as shapes use it: its URL and its scale along x, y and z."""

    url: str
    scale: tuple[float, float, float]


class MujocoUrdf(NamedTuple):
    """URDF text for MuJoCo's reader, and what the mesh names in it stand for."""

    text: str
    meshes: dict[str, MeshUse]


def for_mujoco(urdf: str, robot: Robot) -> MujocoUrdf:
    """
    Return the URDF without what MuJoCo's reader trips over; `robot` is the parsed `urdf`.

    MuJoCo reads neither `package://` nor Collada, so each mesh and scale gets a plain name; it
    refuses a second material in a shape (Unitree's flat Go2 has five), a repeated shape name and
    a material without a colour. Shapes of a kind that URDF does not know are left out, as is what
    is meant for other programs.
    """
    tree = plain_urdf(urdf)
    colours = _colours(tree)
    for material in tree.findall('material'):
        tree.remove(material)
    mend_inertials(tree, robot)
    names: dict[MeshUse, str] = {}
    for link in tree.findall('link'):
        parsed = robot.links[link.get('name', '')]
        for kind, shapes in (('visual', parsed.visuals), ('collision', parsed.collisions)):
            known = [tag for tag in shape_tags(link) if tag.tag == kind]
            for tag in link.findall(kind):
                if tag not in known:
                    link.remove(tag)
            for tag, shape in zip(known, shapes, strict=True):
                tag.attrib.pop('name', None)
                _simplify_material(tag, colours)
                mesh = tag.find('geometry/mesh')
                if mesh is not None:
                    use = MeshUse(shape.url, shape.scale)
                    mesh.attrib.clear()
                    mesh.set('filename', f'{names.setdefault(use, f"mesh_{len(names)}")}.obj')
    options = ElementTree.SubElement(ElementTree.SubElement(tree, 'mujoco'), 'compiler')
    # Visual shapes are dropped while parsing unless the file itself asks for them.
    options.set('discardvisual', 'false')
    text = ElementTree.tostring(tree, encoding='unicode')
    return MujocoUrdf(text, {name: use for use, name in names.items()})


def _colours(tree: ElementTree.Element) -> dict[str, str]:
    """Return the colours by the names of the materials that define them, wherever they do."""
    return {
        material.get('name', ''): _rgba(colour)
        for material in tree.iter('material')
        if (colour := material.find('color')) is not None
    }


def _rgba(colour: ElementTree.Element) -> str:
    """Return a colour as four numbers; grey where it is none."""
    text = colour.get('rgba', '')
    try:
        numbers = [float(number) for number in text.split()]
    except ValueError:
        numbers = []
    return text if len(numbers) == 4 and all(0.0 <= n <= 1.0 for n in numbers) else GREY


def _simplify_material(shape: ElementTree.Element, colours: dict[str, str]) -> None:
    """Leave the first colour of a shape; a texture alone counts as grey."""
    materials = shape.findall('material')
    found = [
        _rgba(colour)
        if (colour := material.find('color')) is not None
        else colours.get(material.get('name', ''))
        for material in materials
    ]
    for material in materials:
        shape.remove(material)
    rgba = next((colour for colour in found if colour is not None), GREY)
    if shape.tag == 'visual':
        material = ElementTree.SubElement(shape, 'material', name=f'rgba {rgba}')
        ElementTree.SubElement(material, 'color', rgba=rgba)
