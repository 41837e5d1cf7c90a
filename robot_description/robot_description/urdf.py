# SPDX-License-Identifier: Apache-2.0
"""A URDF as data: links, joints and where they are; geometry and masses have their home here."""

from dataclasses import dataclass
import math
import xml.etree.ElementTree as ElementTree

import numpy as np

from robot_description.errors import DescriptionError

MOVABLE = ('revolute', 'continuous', 'prismatic')


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
    """One collision primitive: kind, size in URDF's order [m], pose in its link."""

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
    rotation = np.eye(3) + math.sin(angle) * skew + (1.0 - math.cos(angle)) * skew @ skew
    return np.asarray(rotation)


def rpy_matrix(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Return URDF's fixed-axis rotation Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3)."""
    x, y, z = np.eye(3)
    return axis_angle(z, yaw) @ axis_angle(y, pitch) @ axis_angle(x, roll)


def parse_urdf(text: str) -> Robot:
    """
    Parse URDF text.

    Raises:
        DescriptionError: not XML, no links, a joint to a link that does not exist, or a tree with
            no or several roots.

    """
    try:
        tree = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise DescriptionError(f'not well-formed XML: {error}') from None
    links = {link.name: link for link in map(_link, tree.findall('link'))}
    joints = {joint.name: joint for joint in map(_joint, tree.findall('joint'))}
    if not links:
        raise DescriptionError('the description has no links (is a macro call missing "xacro:"?)')
    for joint in joints.values():
        for end in (joint.parent, joint.child):
            if end not in links:
                raise DescriptionError(f'joint {joint.name!r} names link {end!r}, not defined')
    roots = sorted(set(links) - {joint.child for joint in joints.values()})
    if len(roots) != 1:
        raise DescriptionError(f'the links need one root, found {len(roots)}: {", ".join(roots)}')
    friction = {
        str(tag.get('reference')): float(str(tag.findtext('mu1')))
        for tag in tree.findall('gazebo')
        if tag.get('reference') and tag.findtext('mu1')
    }
    return Robot(tree.get('name', ''), roots[0], links, joints, friction)


def _link(tag: ElementTree.Element) -> Link:
    mass = tag.find('inertial/mass')
    shapes = (_shape(collision) for collision in tag.findall('collision'))
    return Link(
        name=tag.get('name', ''),
        mass=float(mass.get('value', '0')) if mass is not None else 0.0,
        collisions=tuple(shape for shape in shapes if shape is not None),
    )


def _shape(tag: ElementTree.Element) -> Shape | None:
    names = {'box': ('size',), 'cylinder': ('radius', 'length'), 'sphere': ('radius',)}
    for kind, attributes in names.items():
        geometry = tag.find(f'geometry/{kind}')
        if geometry is not None:
            numbers = ' '.join(geometry.get(attribute, '') for attribute in attributes).split()
            return Shape(kind, tuple(map(float, numbers)), _origin(tag))
    return None


def _joint(tag: ElementTree.Element) -> Joint:
    axis = _numbers(tag.find('axis'), 'xyz', '1 0 0')
    limit = tag.find('limit')
    limits = limit.attrib if limit is not None else {}
    return Joint(
        name=tag.get('name', ''),
        kind=tag.get('type', 'fixed'),
        parent=_name_of(tag, 'parent'),
        child=_name_of(tag, 'child'),
        pose=_origin(tag),
        axis=axis / np.linalg.norm(axis),
        effort=float(limits.get('effort', 0.0)),
        velocity=float(limits.get('velocity', 0.0)),
    )


def _name_of(joint: ElementTree.Element, end: str) -> str:
    tag = joint.find(end)
    return tag.get('link', '') if tag is not None else ''


def _origin(tag: ElementTree.Element) -> Pose:
    origin = tag.find('origin')
    return Pose(_numbers(origin, 'xyz', '0 0 0'), rpy_matrix(*_numbers(origin, 'rpy', '0 0 0')))


def _numbers(tag: ElementTree.Element | None, attribute: str, default: str) -> np.ndarray:
    text = tag.get(attribute, default) if tag is not None else default
    return np.array([float(number) for number in text.split()])
