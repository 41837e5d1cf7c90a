# SPDX-License-Identifier: Apache-2.0
"""Reads URDF text to a robot; an error is one line."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
import math
from typing import TypeVar
import xml.etree.ElementTree as ElementTree

import numpy as np
from wasd_core.errors import DescriptionError
from wasd_core.rotations import Origin, rpy_matrix
from wasd_core.safe_files import check_xml

from robot_description.morphology.names import hint_at
from robot_description.robot import (
    Colour,
    GREY,
    Joint,
    JOINT_KINDS,
    LIMITED,
    Link,
    LOOSE,
    MOVABLE,
    Robot,
    Shape,
)

# Attributes that give a primitive's size, in URDF's order, and how many numbers they are.
SIZES = {
    'box': (('size',), 3),
    'cylinder': (('radius', 'length'), 2),
    'capsule': (('radius', 'length'), 2),  # the length is that between its balls
    'sphere': (('radius',), 1),
    'mesh': ((), 0),
}
# The upper triangle of an inertia, row by row.
INERTIA_COMPONENTS = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
# A mesh is scaled along x, y and z; what stands behind is passed over.
MOST_SCALES = 3
# Links in a chain; MuJoCo takes a minute to compile 1000 and refuses more.
DEEPEST_TREE = 400
# More names than these are not listed in an error.
MOST_NAMES = 8
# Gazebo has spelt it both ways.
SELF_COLLIDE = ('self_collide', 'selfCollide')
FALSE = ('0', 'false')
Named = TypeVar('Named', Link, Joint)


def read_numbers(
    tag: ElementTree.Element | None, attribute: str, default: str, where: str
) -> np.ndarray:
    """
    Return an attribute's numbers, as many as its default has.

    Raises:
        DescriptionError: see `parse_numbers`.
    """
    text = tag.get(attribute, default) if tag is not None else default
    return parse_numbers(text, len(default.split()), f'{where}: {attribute}')


def parse_numbers(text: str, count: int, where: str) -> np.ndarray:
    """
    Return `count` finite numbers.

    Raises:
        DescriptionError: says where they were wanted, and what was there.
    """
    try:
        numbers = np.array([float(number) for number in text.split()])
    except ValueError:
        numbers = np.array([math.nan])
    if len(numbers) != count or not np.isfinite(numbers).all():
        wanted = 'a number' if count == 1 else f'{count} numbers'
        raise DescriptionError(f'{where} needs {wanted}, got {text!r}')
    return numbers


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
    scale = ' '.join(geometry.get('scale', '1').split()[:MOST_SCALES])
    count = 1 if len(scale.split()) == 1 else MOST_SCALES
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


def parse_urdf(text: str) -> Robot:
    """
    Parse URDF text.

    A root without mass and shapes on which all else hangs by a planar or floating joint stands
    for the robot's surroundings, as do more such links above one: they are left out with their
    joints, and the child is the root.

    Raises:
        DescriptionError: not XML, no links, a name or a child used twice, a joint to a link that
            does not exist, no or several roots, a loop, a mimic of nothing or in a circle, or
            something that is not a number.
    """
    check_xml(text)
    tree = ElementTree.fromstring(text)
    colours = read_colours(tree)
    links = _by_name([_link(tag, colours) for tag in tree.findall('link')])
    joints = _by_name([_joint(tag) for tag in tree.findall('joint')])
    root, notes = _find_root(links, joints), list(_notes(tree))
    for joint in _joints_around(root, links, joints):
        if joint.kind in LOOSE:
            moves = f'move freely in {joint.parent!r}: it floats'
            notes.append(f'joint {joint.name!r} lets the robot {moves}')
        del links[joint.parent], joints[joint.name]
        root = joint.child
    _check_mimics(joints)
    friction, self_collide = _friction(tree), _self_collide(tree)
    gazebo = tuple(tree.findall('gazebo'))
    name = tree.get('name', '')
    return Robot(name, root, links, joints, friction, self_collide, gazebo, notes=tuple(notes))


def _joints_around(
    root: str, links: Mapping[str, Link], joints: Mapping[str, Joint]
) -> list[Joint]:
    """Return the joints from the root down to the last by which the robot moves freely."""
    on: dict[str, list[Joint]] = {}
    for joint in joints.values():
        on.setdefault(joint.parent, []).append(joint)
    found, last = list[Joint](), 0
    while len(on.get(root, ())) == 1 and not links[root].mass and not links[root].shapes:
        found += on[root]
        if found[-1].is_movable:
            break
        root = found[-1].child
        last = len(found) if found[-1].kind in LOOSE else last
    return found[:last]


def _notes(tree: ElementTree.Element) -> Iterator[str]:
    """Yield a line for what is left out, or is not read as it is written."""
    moving = [joint for joint in tree.findall('joint') if joint.get('type') in MOVABLE]
    without = [
        joint.get('name', '')
        for joint in moving
        if (axis := joint.find('axis')) is None or 'xyz' not in axis.attrib
    ]
    if without:
        more = f' and {len(without) - MOST_NAMES} more' if len(without) > MOST_NAMES else ''
        yield (
            f'joints without an axis turn about x, as URDF has it: '
            f'{", ".join(without[:MOST_NAMES])}{more}'
        )
    for joint in moving:
        lower, upper = (_number(joint.find('limit'), end, '0', '') for end in ('lower', 'upper'))
        if joint.get('type') in LIMITED and lower > upper:
            name = joint.get('name')
            yield f'joint {name!r}: lower and upper are exchanged ({lower:g}, {upper:g}): swapped'
    for link in tree.findall('link'):
        for mesh in link.iter('mesh'):
            scale = mesh.get('scale', '')
            if len(scale.split()) > MOST_SCALES:
                yield f'link {link.get("name")!r}: scale="{scale}": the first three numbers count'
    for tag in tree.findall('gazebo'):
        text = tag.findtext('mu1')
        if tag.get('reference') and text and _friction_of(tag) is None:
            yield f'mu1 of {tag.get("reference")!r} is no number, and has no effect: {text!r}'


def _by_name(elements: list[Named]) -> dict[str, Named]:
    by_name: dict[str, Named] = {}
    for element in elements:
        kind = type(element).__name__.lower()
        if not element.name:
            raise DescriptionError(f'a {kind} has no name')
        if element.name in by_name:
            raise DescriptionError(f'{kind} {element.name!r} is defined twice')
        by_name[element.name] = element
    return by_name


def _find_root(links: dict[str, Link], joints: dict[str, Joint]) -> str:
    """Return the root of the tree, having checked that it is one."""
    if not links:
        raise DescriptionError(
            'the description has no links (is a macro call missing "xacro:"? see: describe lint)'
        )
    parents: dict[str, str] = {}
    for joint in joints.values():
        for end in (joint.parent, joint.child):
            if end not in links:
                raise DescriptionError(f'joint {joint.name!r} names link {end!r}, not defined')
        if joint.child in parents:
            raise DescriptionError(f'link {joint.child!r} is the child of two joints')
        parents[joint.child] = joint.parent
    roots = sorted(set(links) - set(parents))
    if len(roots) != 1:
        names = ', '.join(roots[:MOST_NAMES]) + (', ...' if len(roots) > MOST_NAMES else '')
        raise DescriptionError(f'the links need one root, found {len(roots)}: {names}')
    children: dict[str, list[str]] = {link: [] for link in links}
    for child, parent in parents.items():
        children[parent].append(child)
    depths = dict.fromkeys(roots, 1)
    reached = list(roots)
    for link in reached:  # which grows meanwhile
        reached += children[link]
        depths |= dict.fromkeys(children[link], depths[link] + 1)
    if loop := sorted(set(links) - set(reached)):
        raise DescriptionError(f'joints run in a circle through {", ".join(loop)}')
    if (deepest := max(depths.values())) > DEEPEST_TREE:
        raise DescriptionError(
            f'{deepest} links hang on each other in a chain, at most {DEEPEST_TREE} are simulated'
        )
    return roots[0]


def _check_mimics(joints: Mapping[str, Joint]) -> None:
    """Accept joints that mimic others, which follow nobody or others in turn, without a circle."""
    for joint in joints.values():
        followed = [joint.name]
        while other := joints[followed[-1]].mimics:
            if other not in joints:
                hint = hint_at(other, joints)
                raise DescriptionError(
                    f'joint {followed[-1]!r} mimics joint {other!r}, which is not there{hint}'
                )
            if other in followed:
                circle = ' -> '.join([*followed[followed.index(other) :], other])
                raise DescriptionError(f'joints mimic each other in a circle: {circle}')
            followed.append(other)


def _link(tag: ElementTree.Element, colours: Mapping[str, Colour]) -> Link:
    name = tag.get('name', '')
    where = f'link {name!r}'
    return Link(
        name=name,
        mass=_number(tag.find('inertial/mass'), 'value', '0', where),
        inertia=_inertia(tag.find('inertial/inertia'), where),
        inertial=read_origin(tag.find('inertial'), f'{where}: inertial'),
        shapes=tuple(read_shape(shape, colours, where) for shape in shape_tags(tag)),
    )


def _inertia(tag: ElementTree.Element | None, where: str) -> np.ndarray:
    xx, xy, xz, yy, yz, zz = (_number(tag, c, '0', where) for c in INERTIA_COMPONENTS)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _joint(tag: ElementTree.Element) -> Joint:
    name = tag.get('name', '')
    where = f'joint {name!r}'
    kind = tag.get('type', 'fixed')
    has_axis = kind in MOVABLE or kind == 'planar'
    axis = read_numbers(tag.find('axis') if has_axis else None, 'xyz', '1 0 0', where)
    if not axis.any():
        raise DescriptionError(f'{where}: its axis is zero')
    if kind not in JOINT_KINDS:
        raise DescriptionError(f'{where}: type {kind!r}, wanted one of {", ".join(JOINT_KINDS)}')
    axis = axis / np.abs(axis).max()  # so that its length neither overflows nor vanishes
    limit, dynamics, mimic = tag.find('limit'), tag.find('dynamics'), tag.find('mimic')
    lower, upper = (_number(limit, end, '0', where) for end in ('lower', 'upper'))
    # Limits of zero are none; exchanged ones are swapped.
    is_free = kind not in LIMITED or limit is None or lower == upper == 0.0
    return Joint(
        name=name,
        kind=kind,
        parent=_name_of(tag, 'parent'),
        child=_name_of(tag, 'child'),
        pose=read_origin(tag, where),
        axis=axis / np.linalg.norm(axis),
        effort=_number(limit, 'effort', '0', where),
        velocity=_number(limit, 'velocity', '0', where),
        lower=-math.inf if is_free else min(lower, upper),
        upper=math.inf if is_free else max(lower, upper),
        damping=_loss(dynamics, 'damping', where),
        friction=_loss(dynamics, 'friction', where),
        mimics=mimic.get('joint', '') if mimic is not None else '',
        multiplier=_number(mimic, 'multiplier', '1', where),
        offset=_number(mimic, 'offset', '0', where),
        has_effort=limit is not None and 'effort' in limit.attrib,
        has_velocity=limit is not None and 'velocity' in limit.attrib,
    )


def _number(tag: ElementTree.Element | None, attribute: str, default: str, where: str) -> float:
    return float(read_numbers(tag, attribute, default, where)[0])


def _loss(dynamics: ElementTree.Element | None, attribute: str, where: str) -> float:
    """Return what takes energy of a motion: below zero it would drive the joint."""
    loss = _number(dynamics, attribute, '0', where)
    if loss < 0.0:
        raise DescriptionError(f'{where}: {attribute} needs a number from 0 up, got {loss:g}')
    return loss


def _name_of(joint: ElementTree.Element, end: str) -> str:
    tag = joint.find(end)
    return tag.get('link', '') if tag is not None else ''


def _friction(tree: ElementTree.Element) -> dict[str, float]:
    """Return the first friction coefficient, mu1, of the links that give one."""
    return {
        str(tag.get('reference')): friction
        for tag in tree.findall('gazebo')
        if tag.get('reference') and (friction := _friction_of(tag)) is not None
    }


def _friction_of(gazebo: ElementTree.Element) -> float | None:
    """Return what a tag of Gazebo's says of friction, if it is a number that friction can be."""
    try:
        value = float(gazebo.findtext('mu1') or '')
    except ValueError:
        return None
    return value if math.isfinite(value) and value >= 0.0 else None


def _self_collide(tree: ElementTree.Element) -> dict[str, bool]:
    """Return whether links that say so may touch other links of the robot."""
    said = {}
    for tag in tree.findall('gazebo'):
        for name in SELF_COLLIDE:
            text = tag.findtext(name)
            if tag.get('reference') and text is not None:
                said[str(tag.get('reference'))] = text.strip().lower() not in FALSE
    return said
