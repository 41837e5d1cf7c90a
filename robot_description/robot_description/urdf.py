# SPDX-License-Identifier: Apache-2.0
"""A URDF as data: links, joints and where they are; geometry and masses have their home here."""

from dataclasses import dataclass
import math
from typing import TypeVar
import xml.etree.ElementTree as ElementTree

import numpy as np

from robot_description.errors import DescriptionError

MOVABLE = ('revolute', 'continuous', 'prismatic')
# Attributes that give a primitive's size, in URDF's order, and how many numbers they are.
SIZES = {
    'box': (('size',), 3),
    'cylinder': (('radius', 'length'), 2),
    'sphere': (('radius',), 1),
    'mesh': ((), 0),
}


@dataclass(frozen=True)
class Pose:
    """Position [m], shape (3,), and rotation matrix, shape (3, 3), of a frame in its parent."""

    position: np.ndarray
    rotation: np.ndarray

    def __matmul__(self, other: 'Pose') -> 'Pose':
        """Compose: `T_a_b @ T_b_c` is `T_a_c`."""
        return Pose(self.position + self.rotation @ other.position, self.rotation @ other.rotation)


IDENTITY = Pose(np.zeros(3), np.eye(3))


@dataclass(frozen=True)
class Shape:
    """One collision shape: kind, size in URDF's order [m] (none for a mesh), pose in its link."""

    kind: str
    size: tuple[float, ...]
    pose: Pose


@dataclass(frozen=True)
class Link:
    """A link: its mass [kg], 0 without an inertial, and its collision shapes."""

    name: str
    mass: float
    collisions: tuple[Shape, ...]


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
    def movable_joints(self) -> tuple[Joint, ...]:
        """Joints with a degree of freedom, in the order of the file."""
        return tuple(joint for joint in self.joints.values() if joint.kind in MOVABLE)

    def pose_of(self, link: str) -> Pose:
        """Return a link's pose in the root with every joint at 0."""
        chain = []
        by_child = {joint.child: joint for joint in self.joints.values()}
        while link != self.root:
            chain.append(by_child[link])
            link = by_child[link].parent
        pose = IDENTITY
        for joint in reversed(chain):
            pose = pose @ joint.pose
        return pose


def axis_angle(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the rotation by `angle` [rad] about a unit axis (Rodrigues), shape (3, 3)."""
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation: np.ndarray = np.eye(3) + math.sin(angle) * skew
    rotation += (1.0 - math.cos(angle)) * skew @ skew
    return rotation


def rpy_matrix(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Return URDF's fixed-axis rotation Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3)."""
    x, y, z = np.eye(3)
    rotation: np.ndarray = axis_angle(z, yaw) @ axis_angle(y, pitch) @ axis_angle(x, roll)
    return rotation


def parse_urdf(text: str) -> Robot:
    """
    Parse URDF text.

    Raises:
        DescriptionError: not XML, no links, a name or a child used twice, a joint to a link that
            does not exist, no or several roots, a loop, or something that is not a number.
    """
    try:
        tree = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise DescriptionError(f'not well-formed XML: {error}') from None
    links = _by_name([_link(tag) for tag in tree.findall('link')])
    joints = _by_name([_joint(tag) for tag in tree.findall('joint')])
    friction = {
        str(tag.get('reference')): float(_parse(str(tag.findtext('mu1')), 1, 'mu1')[0])
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
    reached = set(roots)
    while found := {link for link in parents if parents[link] in reached} - reached:
        reached |= found
    if loop := sorted(set(links) - reached):
        raise DescriptionError(f'joints run in a circle through {", ".join(loop)}')
    return roots[0]


def _link(tag: ElementTree.Element) -> Link:
    name = tag.get('name', '')
    where = f'link {name!r}'
    shapes = (_shape(collision, where) for collision in tag.findall('collision'))
    return Link(
        name=name,
        mass=float(_numbers(tag.find('inertial/mass'), 'value', '0', where)[0]),
        collisions=tuple(shape for shape in shapes if shape is not None),
    )


def _shape(tag: ElementTree.Element, where: str) -> Shape | None:
    for kind, (attributes, count) in SIZES.items():
        geometry = tag.find(f'geometry/{kind}')
        if geometry is not None:
            text = ' '.join(geometry.get(attribute, '') for attribute in attributes)
            size = _parse(text, count, f'{where}: {kind}')
            return Shape(kind, tuple(size.tolist()), _origin(tag, where))
    return None


def _joint(tag: ElementTree.Element) -> Joint:
    name = tag.get('name', '')
    where = f'joint {name!r}'
    kind = tag.get('type', 'fixed')
    axis = _numbers(tag.find('axis') if kind in MOVABLE else None, 'xyz', '1 0 0', where)
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
        effort=float(_numbers(limit, 'effort', '0', where)[0]),
        velocity=float(_numbers(limit, 'velocity', '0', where)[0]),
    )


def _name_of(joint: ElementTree.Element, end: str) -> str:
    tag = joint.find(end)
    return tag.get('link', '') if tag is not None else ''


def _origin(tag: ElementTree.Element, where: str) -> Pose:
    origin = tag.find('origin')
    roll, pitch, yaw = _numbers(origin, 'rpy', '0 0 0', where)
    return Pose(_numbers(origin, 'xyz', '0 0 0', where), rpy_matrix(roll, pitch, yaw))


def _numbers(
    tag: ElementTree.Element | None, attribute: str, default: str, where: str
) -> np.ndarray:
    """Return an attribute's numbers, as many as its default has."""
    text = tag.get(attribute, default) if tag is not None else default
    return _parse(text, len(default.split()), f'{where}: {attribute}')


def _parse(text: str, count: int, where: str) -> np.ndarray:
    try:
        numbers = np.array([float(number) for number in text.split()])
    except ValueError:
        numbers = np.array([math.nan])
    if len(numbers) != count or not np.isfinite(numbers).all():
        wanted = 'a number' if count == 1 else f'{count} numbers'
        raise DescriptionError(f'{where} needs {wanted}, got {text!r}')
    return numbers
