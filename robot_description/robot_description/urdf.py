# SPDX-License-Identifier: Apache-2.0
"""A URDF as data: links, joints and where they are; geometry and masses have their home here."""

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar
import xml.etree.ElementTree as ElementTree

import numpy as np

from robot_description.errors import DescriptionError
from robot_description.pose import axis_angle
from robot_description.pose import IDENTITY
from robot_description.pose import Pose
from robot_description.pose import rpy_matrix
from robot_description.safe_reading import check_xml
from robot_description.urdf_numbers import parse_numbers
from robot_description.urdf_numbers import read_numbers

MOVABLE = ('revolute', 'continuous', 'prismatic')
# Attributes that give a primitive's size, in URDF's order, and how many numbers they are.
SIZES = {
    'box': (('size',), 3),
    'cylinder': (('radius', 'length'), 2),
    'sphere': (('radius',), 1),
    'mesh': ((), 0),
}
# The upper triangle of an inertia, row by row.
INERTIA_COMPONENTS = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
# A root link of this name is no part of the robot: what hangs on it does not float.
WORLD_LINK = 'world'


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


@dataclass(frozen=True)
class Link:
    """
    A link: its mass [kg], what collides and what is drawn.

    `inertia` (3, 3) [kg m^2] is about its centre of mass, in the axes of its inertial frame. Both
    are 0 without an inertial.
    """

    name: str
    mass: float
    inertia: np.ndarray
    collisions: tuple[Shape, ...]
    visuals: tuple[Shape, ...]


@dataclass(frozen=True)
class Joint:
    """A joint: `pose` is the joint frame in the parent link at position 0; effort [N m] or [N]."""

    name: str
    kind: str
    parent: str
    child: str
    pose: Pose
    axis: np.ndarray
    effort: float
    velocity: float

    def transform(self, position: float) -> Pose:
        """Return the child's pose in the parent at a joint position [rad] or [m]."""
        if self.kind in ('revolute', 'continuous'):
            return self.pose @ Pose(np.zeros(3), axis_angle(self.axis, position))
        if self.kind == 'prismatic':
            return self.pose @ Pose(self.axis * position, np.eye(3))
        return self.pose


Named = TypeVar('Named', Link, Joint)


@dataclass(frozen=True)
class Robot:
    """A kinematic tree; `friction` maps a link to the mu1 of its gazebo tag."""

    name: str
    root: str
    links: dict[str, Link]
    joints: dict[str, Joint]
    friction: dict[str, float]

    @property
    def mass(self) -> float:
        """Sum of the link masses [kg]."""
        return sum(link.mass for link in self.links.values())

    @property
    def is_fixed(self) -> bool:
        """Whether the robot hangs on a link called `world`."""
        return self.root == WORLD_LINK

    @property
    def base(self) -> str:
        """The link that carries the others: the root, or what hangs on the world first."""
        if not self.is_fixed:
            return self.root
        return next((j.child for j in self.joints.values() if j.parent == self.root), self.root)

    @property
    def movable_joints(self) -> tuple[Joint, ...]:
        """Joints with a degree of freedom, in the order of the file."""
        return tuple(joint for joint in self.joints.values() if joint.kind in MOVABLE)

    @cached_property
    def parent_joints(self) -> dict[str, Joint]:
        """The joint that holds each link but the root."""
        return {joint.child: joint for joint in self.joints.values()}

    @cached_property
    def links_from_root(self) -> tuple[str, ...]:
        """The links, each after its parent, brothers in the order of the file."""
        children: dict[str, list[str]] = {link: [] for link in self.links}
        for joint in self.joints.values():
            children[joint.parent].append(joint.child)
        order = []
        waiting = [self.root]
        while waiting:
            order.append(link := waiting.pop())
            waiting += reversed(children[link])
        return tuple(order)

    @property
    def welded_to_root(self) -> set[str]:
        """The root and the links that cannot move against it."""
        welded = {self.root}
        for link in self.links_from_root[1:]:
            joint = self.parent_joints[link]
            if joint.kind == 'fixed' and joint.parent in welded:
                welded.add(link)
        return welded

    def pose_of(self, link: str) -> Pose:
        """Return a link's pose in the root with every joint at 0."""
        chain = []
        while link != self.root:
            chain.append(self.parent_joints[link])
            link = chain[-1].parent
        pose = IDENTITY
        for joint in reversed(chain):
            pose = pose @ joint.pose
        return pose


def parse_urdf(text: str) -> Robot:
    """
    Parse URDF text.

    Raises:
        DescriptionError: not XML, no links, a name or a child used twice, a joint to a link that
            does not exist, no or several roots, a loop, or something that is not a number.
    """
    check_xml(text)
    tree = ElementTree.fromstring(text)
    links = _by_name([_link(tag) for tag in tree.findall('link')])
    joints = _by_name([_joint(tag) for tag in tree.findall('joint')])
    friction = {
        str(tag.get('reference')): float(parse_numbers(str(tag.findtext('mu1')), 1, 'mu1')[0])
        for tag in tree.findall('gazebo')
        if tag.get('reference') and tag.findtext('mu1')
    }
    return Robot(tree.get('name', ''), _find_root(links, joints), links, joints, friction)


def _by_name(elements: list[Named]) -> dict[str, Named]:
    by_name: dict[str, Named] = {}
    for element in elements:
        if element.name in by_name:
            kind = type(element).__name__.lower()
            raise DescriptionError(f'{kind} {element.name!r} is defined twice')
        by_name[element.name] = element
    return by_name


def _find_root(links: dict[str, Link], joints: dict[str, Joint]) -> str:
    """Return the root of the tree, having checked that it is one."""
    if not links:
        raise DescriptionError('the description has no links (is a macro call missing "xacro:"?)')
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
        raise DescriptionError(f'the links need one root, found {len(roots)}: {", ".join(roots)}')
    children: dict[str, list[str]] = {link: [] for link in links}
    for child, parent in parents.items():
        children[parent].append(child)
    reached = list(roots)
    for link in reached:  # which grows meanwhile
        reached += children[link]
    if loop := sorted(set(links) - set(reached)):
        raise DescriptionError(f'joints run in a circle through {", ".join(loop)}')
    return roots[0]


def _link(tag: ElementTree.Element) -> Link:
    name = tag.get('name', '')
    where = f'link {name!r}'
    return Link(
        name=name,
        mass=float(read_numbers(tag.find('inertial/mass'), 'value', '0', where)[0]),
        inertia=_inertia(tag.find('inertial/inertia'), where),
        collisions=tuple(_shape(shape, where) for shape in shape_tags(tag, 'collision')),
        visuals=tuple(_shape(shape, where) for shape in shape_tags(tag, 'visual')),
    )


def _inertia(tag: ElementTree.Element | None, where: str) -> np.ndarray:
    xx, xy, xz, yy, yz, zz = (
        float(read_numbers(tag, c, '0', where)[0]) for c in INERTIA_COMPONENTS
    )
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def shape_tags(link: ElementTree.Element, tag: str) -> list[ElementTree.Element]:
    """Return the `visual` or `collision` tags of a link that have a geometry of URDF's."""
    return [
        shape
        for shape in link.findall(tag)
        if any(shape.find(f'geometry/{kind}') is not None for kind in SIZES)
    ]


def _shape(tag: ElementTree.Element, where: str) -> Shape:
    kind, geometry = next(
        (kind, found) for kind in SIZES if (found := tag.find(f'geometry/{kind}')) is not None
    )
    attributes, count = SIZES[kind]
    text = ' '.join(geometry.get(attribute, '') for attribute in attributes)
    size = tuple(parse_numbers(text, count, f'{where}: {kind}').tolist())
    pose = _origin(tag, where)
    if kind != 'mesh':
        return Shape(kind, size, pose)
    scale = geometry.get('scale', '1')
    count = 1 if len(scale.split()) == 1 else 3
    x, y, z = np.broadcast_to(parse_numbers(scale, count, f'{where}: scale'), 3).tolist()
    return Shape(kind, size, pose, geometry.get('filename', ''), (x, y, z))


def _joint(tag: ElementTree.Element) -> Joint:
    name = tag.get('name', '')
    where = f'joint {name!r}'
    kind = tag.get('type', 'fixed')
    axis = read_numbers(tag.find('axis') if kind in MOVABLE else None, 'xyz', '1 0 0', where)
    if not axis.any():
        raise DescriptionError(f'{where}: its axis is zero')
    limit = tag.find('limit')
    return Joint(
        name=name,
        kind=kind,
        parent=_name_of(tag, 'parent'),
        child=_name_of(tag, 'child'),
        pose=_origin(tag, where),
        axis=axis / np.linalg.norm(axis),
        effort=float(read_numbers(limit, 'effort', '0', where)[0]),
        velocity=float(read_numbers(limit, 'velocity', '0', where)[0]),
    )


def _name_of(joint: ElementTree.Element, end: str) -> str:
    tag = joint.find(end)
    return tag.get('link', '') if tag is not None else ''


def _origin(tag: ElementTree.Element, where: str) -> Pose:
    origin = tag.find('origin')
    roll, pitch, yaw = read_numbers(origin, 'rpy', '0 0 0', where)
    return Pose(read_numbers(origin, 'xyz', '0 0 0', where), rpy_matrix(roll, pitch, yaw))
