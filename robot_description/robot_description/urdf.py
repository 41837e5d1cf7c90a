# SPDX-License-Identifier: Apache-2.0
"""A URDF as data: links, joints and where they are; geometry and masses have their home here."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
import math
from typing import TypeVar
import xml.etree.ElementTree as ElementTree

import numpy as np
from wasd_core.errors import DescriptionError
from wasd_core.rotations import axis_angle
from wasd_core.rotations import IDENTITY
from wasd_core.rotations import Origin
from wasd_core.rotations import Pose
from wasd_core.safe_files import check_xml

from robot_description.urdf_numbers import parse_numbers
from robot_description.urdf_numbers import read_numbers
from robot_description.urdf_shapes import Colour
from robot_description.urdf_shapes import read_colours
from robot_description.urdf_shapes import read_origin
from robot_description.urdf_shapes import read_shape
from robot_description.urdf_shapes import Shape
from robot_description.urdf_shapes import shape_tags

MOVABLE = ('revolute', 'continuous', 'prismatic')
JOINT_KINDS = (*MOVABLE, 'fixed', 'floating', 'planar')
# The upper triangle of an inertia, row by row.
INERTIA_COMPONENTS = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
# A root link of this name is no part of the robot: what hangs on it does not float.
WORLD_LINK = 'world'
# The joint by which a robot floats, where a library wants a name for it.
ROOT_JOINT = 'root'
# More names than these are not listed in an error.
MOST_NAMES = 8
# Gazebo has spelt it both ways.
SELF_COLLIDE = ('self_collide', 'selfCollide')
FALSE = ('0', 'false')


@dataclass(frozen=True)
class Link:
    """
    A link: its mass [kg], what collides and what is drawn.

    `inertia` (3, 3) [kg m^2] is about its centre of mass, in the axes of its inertial frame, whose
    pose in the link is `inertial`. Mass and inertia are 0 without an inertial. `shapes` are in the
    order of the file.
    """

    name: str
    mass: float
    inertia: np.ndarray
    inertial: Origin
    shapes: tuple[Shape, ...]

    @cached_property
    def collisions(self) -> tuple[Shape, ...]:
        """What collides."""
        return tuple(shape for shape in self.shapes if shape.collides)

    @cached_property
    def visuals(self) -> tuple[Shape, ...]:
        """What is drawn."""
        return tuple(shape for shape in self.shapes if not shape.collides)


@dataclass(frozen=True)
class Joint:
    """
    A joint: `pose` is the joint frame in the parent link at position 0.

    Positions are in [rad] or [m], effort in [N m] or [N], velocity in [rad/s] or [m/s]; without
    limits `lower` and `upper` are infinite. Viscous `damping` is in [N m s/rad] or [N s/m], dry
    `friction` in [N m] or [N]. `mimics` names the joint that it follows, if any, at
    `multiplier * position + offset`.
    """

    name: str
    kind: str
    parent: str
    child: str
    pose: Origin
    axis: np.ndarray
    effort: float
    velocity: float
    lower: float
    upper: float
    damping: float
    friction: float
    mimics: str
    multiplier: float
    offset: float

    @property
    def is_movable(self) -> bool:
        """Whether it has one degree of freedom."""
        return self.kind in MOVABLE

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
    """
    A kinematic tree.

    `friction` and `self_collide` map a link to what its gazebo tag says, where it does; `gazebo`
    are these tags, for what a simulator looks for in them.
    """

    name: str
    root: str
    links: dict[str, Link]
    joints: dict[str, Joint]
    friction: dict[str, float]
    self_collide: dict[str, bool]
    gazebo: tuple[ElementTree.Element, ...]

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
        return tuple(joint for joint in self.joints.values() if joint.is_movable)

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

    @cached_property
    def carriers(self) -> dict[str, str]:
        """For each link the one that moves with it and has a joint of its own, or is the root."""
        carriers: dict[str, str] = {}
        for link in self.links_from_root:
            joint = self.parent_joints.get(link)
            welded = joint is not None and joint.kind == 'fixed'
            carriers[link] = carriers[joint.parent] if joint is not None and welded else link
        return carriers

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
    colours = read_colours(tree)
    links = _by_name([_link(tag, colours) for tag in tree.findall('link')])
    joints = _by_name([_joint(tag) for tag in tree.findall('joint')])
    root = _find_root(links, joints)
    friction, self_collide = _friction(tree), _self_collide(tree)
    gazebo = tuple(tree.findall('gazebo'))
    return Robot(tree.get('name', ''), root, links, joints, friction, self_collide, gazebo)


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
    reached = list(roots)
    for link in reached:  # which grows meanwhile
        reached += children[link]
    if loop := sorted(set(links) - set(reached)):
        raise DescriptionError(f'joints run in a circle through {", ".join(loop)}')
    return roots[0]


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
    axis = read_numbers(tag.find('axis') if kind in MOVABLE else None, 'xyz', '1 0 0', where)
    if not axis.any():
        raise DescriptionError(f'{where}: its axis is zero')
    if kind not in JOINT_KINDS:
        raise DescriptionError(f'{where}: type {kind!r}, wanted one of {", ".join(JOINT_KINDS)}')
    limit, dynamics, mimic = tag.find('limit'), tag.find('dynamics'), tag.find('mimic')
    lower, upper = (_number(limit, end, '0', where) for end in ('lower', 'upper'))
    is_free = kind not in ('revolute', 'prismatic') or limit is None or lower >= upper
    return Joint(
        name=name,
        kind=kind,
        parent=_name_of(tag, 'parent'),
        child=_name_of(tag, 'child'),
        pose=read_origin(tag, where),
        axis=axis / np.linalg.norm(axis),
        effort=_number(limit, 'effort', '0', where),
        velocity=_number(limit, 'velocity', '0', where),
        lower=-math.inf if is_free else lower,
        upper=math.inf if is_free else upper,
        damping=_number(dynamics, 'damping', '0', where),
        friction=_number(dynamics, 'friction', '0', where),
        mimics=mimic.get('joint', '') if mimic is not None else '',
        multiplier=_number(mimic, 'multiplier', '1', where),
        offset=_number(mimic, 'offset', '0', where),
    )


def _number(tag: ElementTree.Element | None, attribute: str, default: str, where: str) -> float:
    return float(read_numbers(tag, attribute, default, where)[0])


def _name_of(joint: ElementTree.Element, end: str) -> str:
    tag = joint.find(end)
    return tag.get('link', '') if tag is not None else ''


def _friction(tree: ElementTree.Element) -> dict[str, float]:
    """
    Return the first friction coefficient, mu1, of the links that give one.

    Raises:
        DescriptionError: it is no number.
    """
    return {
        str(tag.get('reference')): float(parse_numbers(str(tag.findtext('mu1')), 1, 'mu1')[0])
        for tag in tree.findall('gazebo')
        if tag.get('reference') and tag.findtext('mu1')
    }


def _self_collide(tree: ElementTree.Element) -> dict[str, bool]:
    """Return whether links that say so may touch other links of the robot."""
    said = {}
    for tag in tree.findall('gazebo'):
        for name in SELF_COLLIDE:
            text = tag.findtext(name)
            if tag.get('reference') and text is not None:
                said[str(tag.get('reference'))] = text.strip().lower() not in FALSE
    return said
