# SPDX-License-Identifier: Apache-2.0
"""A URDF as MuJoCo's own reader could take it: half of the reference of its successor."""

from typing import NamedTuple
import xml.etree.ElementTree as ElementTree

import numpy as np
from robot_description.errors import DescriptionError
from robot_description.inertia import possible_inertia
from robot_description.urdf import INERTIA_COMPONENTS
from robot_description.urdf import MOVABLE
from robot_description.urdf import Robot
from robot_description.urdf_shapes import SIZES

SHAPES = ('visual', 'collision')


def plain_urdf(urdf: str) -> ElementTree.Element:
    """
    Return links and joints of a URDF that `parse_urdf` accepts, said in one way.

    Of repeated tags the first counts, as for `parse_urdf`; what is left out is URDF's default.
    Materials stay as they are. Limits of no width and the imitation of no joint are dropped.
    """
    tree = ElementTree.fromstring(urdf)
    for element in list(tree):
        if element.tag not in ('link', 'joint', 'material'):
            tree.remove(element)
    for link in tree.findall('link'):
        _keep_first(link, several=SHAPES)
        for shape in [*link.findall('visual'), *link.findall('collision')]:
            _keep_first(shape, several=('material',))
            _keep_one_kind(shape)
        inertial = link.find('inertial')
        if inertial is not None:
            _keep_first(inertial)
            for mass in inertial.findall('mass'):
                mass.set('value', mass.get('value', '0'))
            for inertia in inertial.findall('inertia'):
                for component in INERTIA_COMPONENTS:
                    inertia.set(component, inertia.get(component, '0'))
    movable = {j.get('name') for j in tree.findall('joint') if j.get('type') in MOVABLE}
    for joint in tree.findall('joint'):
        _keep_first(joint)
        joint.set('type', joint.get('type', 'fixed'))
        _drop_idle_words(joint, movable)
    return tree


def _keep_first(element: ElementTree.Element, several: tuple[str, ...] = ()) -> None:
    seen: set[str] = set()
    for child in list(element):
        if child.tag in seen and child.tag not in several:
            element.remove(child)
        seen.add(child.tag)


def _keep_one_kind(shape: ElementTree.Element) -> None:
    """Leave the kind of shape that `read_shape` reads."""
    geometry = shape.find('geometry')
    if geometry is None:
        return
    kind = next((kind for kind in SIZES if geometry.find(kind) is not None), None)
    for child in list(geometry):
        if child is not geometry.find(kind or ''):
            geometry.remove(child)


def _drop_idle_words(joint: ElementTree.Element, movable: set[str | None]) -> None:
    axis, limit, mimic = (joint.find(tag) for tag in ('axis', 'limit', 'mimic'))
    if axis is not None and (joint.get('type') not in MOVABLE or 'xyz' not in axis.attrib):
        joint.remove(axis)
    if mimic is not None and not {joint.get('name'), mimic.get('joint')} <= movable:
        joint.remove(mimic)
    if limit is not None and float(limit.get('lower', '0')) == float(limit.get('upper', '0')):
        limit.attrib.pop('lower', None)
        limit.attrib.pop('upper', None)


# A link without mass between two joints, as a hip of three axes has, gets so much [kg], [kg m^2].
NEXT_TO_NOTHING = 1e-9


def mend_inertials(tree: ElementTree.Element, robot: Robot) -> None:
    """
    Mend the inertials of a URDF tree for MuJoCo: the nearest possible for an impossible one.

    `robot` is the parsed tree.

    Raises:
        DescriptionError: a joint moves nothing that has a mass.
    """
    virtual = _virtual_links(robot)
    for tag in tree.findall('link'):
        link = robot.links[tag.get('name', '')]
        inertial = tag.find('inertial')
        if link.mass > 0.0 and inertial is not None:
            better = possible_inertia(link.inertia, link.mass)
            if better is not None:
                _write_inertia(inertial, better)
            continue
        if inertial is not None:
            tag.remove(inertial)
        if link.name in virtual:
            inertial = ElementTree.SubElement(tag, 'inertial')
            ElementTree.SubElement(inertial, 'mass', value=str(NEXT_TO_NOTHING))
            _write_inertia(inertial, NEXT_TO_NOTHING * np.eye(3))


def _write_inertia(inertial: ElementTree.Element, inertia: np.ndarray) -> None:
    tag = inertial.find('inertia')
    if tag is None:
        tag = ElementTree.SubElement(inertial, 'inertia')
    for component, value in zip(INERTIA_COMPONENTS, inertia[np.triu_indices(3)], strict=True):
        tag.set(component, repr(float(value)))


def _virtual_links(robot: Robot) -> set[str]:
    """
    Return the links that move without a mass of their own, with one further out.

    Raises:
        DescriptionError: there is a link that moves without any.
    """
    welded = dict.fromkeys(robot.links, 0.0)
    beyond = dict(welded)
    for link in reversed(robot.links_from_root):
        mass = robot.links[link].mass
        welded[robot.carriers[link]] += mass
        beyond[link] += mass
        if link != robot.root:
            beyond[robot.parent_joints[link].parent] += beyond[link]
    virtual = set()
    for link in robot.links_from_root:
        joint = robot.parent_joints.get(link)
        stays = robot.carriers[link] != link or joint is None and robot.is_fixed
        if stays or welded[link] > 0.0:
            continue
        if beyond[link] <= 0.0:
            by = f' (joint {joint.name!r})' if joint is not None else ''
            has = f'a mass of {beyond[link]:g} kg' if beyond[link] else 'no mass'
            raise DescriptionError(
                f'link {link!r} moves{by} but has {has}: '
                'give it an <inertial> with <mass> and <inertia>'
            )
        virtual.add(link)
    return virtual


GREY = '0.7 0.7 0.7 1'


class MeshUse(NamedTuple):
    """A mesh as shapes use it: its URL and its scale along x, y and z."""

    url: str
    scale: tuple[float, float, float]


class MujocoUrdf(NamedTuple):
    """URDF text for MuJoCo's reader, and what the mesh names in it stand for."""

    text: str
    meshes: dict[str, MeshUse]


def shape_tags(link: ElementTree.Element, tag: str) -> list[ElementTree.Element]:
    return [
        shape
        for shape in link.findall(tag)
        if any(shape.find(f'geometry/{kind}') is not None for kind in SIZES)
    ]


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
            known = shape_tags(link, kind)
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
