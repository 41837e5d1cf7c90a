# SPDX-License-Identifier: Apache-2.0
"""A description as lint sees it, wrong or not: its files as text, its elements after xacro."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from wasd_core.rotations import IDENTITY, Pose, rpy_matrix
from wasd_core.safe_files import Place

from robot_description.robot import MOVABLE
from robot_description.xacro.session import Expansion

MOVING_KINDS = (*MOVABLE, 'floating', 'planar')


@dataclass(frozen=True, eq=False)
class Element:
    """An XML element and where it stood before xacro moved it."""

    tag: str
    attributes: dict[str, str]
    text: str
    children: tuple['Element', ...]
    place: Place

    @property
    def name(self) -> str:
        """Its `name` attribute, or nothing."""
        return self.attributes.get('name', '')

    def all(self, tag: str) -> list['Element']:
        """Return its children of that tag."""
        return [child for child in self.children if child.tag == tag]

    def find(self, path: str) -> 'Element | None':
        """Return the first element at a path of tags, `inertial/mass`, or None."""
        here = self
        for tag in path.split('/'):
            found = next((child for child in here.children if child.tag == tag), None)
            if found is None:
                return None
            here = found
        return here

    def walk(self) -> Iterator['Element']:
        """Yield it and everything in it."""
        yield self
        for child in self.children:
            yield from child.walk()

    def numbers(self, path: str, attribute: str, default: str) -> np.ndarray:
        """Return an attribute's numbers; the default's when they are not as many or not finite."""
        tag = self.find(path) if path else self
        for text in (tag.attributes.get(attribute, default) if tag else default, default):
            try:
                numbers = np.array([float(number) for number in text.split()])
            except ValueError:
                continue
            if len(numbers) == len(default.split()) and np.isfinite(numbers).all():
                return numbers
        raise AssertionError(f'default {default!r} is no numbers')

    def number(self, path: str, attribute: str, default: float = 0.0) -> float:
        """Return an attribute's number, or the default."""
        return float(self.numbers(path, attribute, repr(default))[0])

    def origin(self) -> Pose:
        """Return the pose of its `origin`, as far as it has one."""
        roll, pitch, yaw = self.numbers('origin', 'rpy', '0 0 0')
        return Pose(self.numbers('origin', 'xyz', '0 0 0'), rpy_matrix(roll, pitch, yaw))


def to_element(expansion: Expansion) -> Element:
    """Return the root of an expansion with all that is in it."""
    children: list[list[Element]] = [[] for _ in expansion.nodes]
    for index, row in reversed(list(enumerate(expansion.nodes))):
        tag, attributes, text, (file, *at), parent = row
        within = tuple(reversed(children[index]))
        root = Element(tag, attributes, text, within, Place(Path(file), *at))
        if parent >= 0:
            children[parent].append(root)
    return root


@dataclass(frozen=True, eq=False)
class Model:
    """A robot element and what is known about its file."""

    robot: Element
    path: Path
    search: Sequence[Path] = ()
    expected_joints: Sequence[str] = ()

    @cached_property
    def links(self) -> dict[str, Element]:
        """Links by name; the first of several."""
        return {link.name: link for link in reversed(self.robot.all('link')) if link.name}

    @cached_property
    def joints(self) -> dict[str, Element]:
        """Joints by name; the first of several. Those in plugins and transmissions are others."""
        joints = [joint for joint in self.robot.all('joint') if joint.name]
        return {joint.name: joint for joint in reversed(joints)}

    @cached_property
    def joint_above(self) -> dict[str, Element]:
        """The joint that holds a link."""
        joints = reversed(self.robot.all('joint'))
        return {child: joint for joint in joints if (child := end(joint, 'child'))}

    @cached_property
    def moving_links(self) -> set[str]:
        """Links that move against the one that holds them."""
        return {
            link
            for link, joint in self.joint_above.items()
            if joint.attributes.get('type') in MOVING_KINDS
        }

    @cached_property
    def roots(self) -> dict[str, str]:
        """The root that each link hangs on, parents before children; none for circles."""
        found = {link: link for link in self.links if link not in self.joint_above}
        below: dict[str, list[str]] = {}
        for link, joint in self.joint_above.items():
            below.setdefault(end(joint, 'parent'), []).append(link)
        waiting = list(found)
        for link in waiting:  # which grows meanwhile
            for child in below.get(link, []):
                found[child] = found[link]
                waiting.append(child)
        return found

    @cached_property
    def poses(self) -> dict[str, Pose]:
        """Pose of each link in its root with all joints at zero; none for links in circles."""
        poses: dict[str, Pose] = {}
        for link in self.roots:
            joint = self.joint_above.get(link)
            if joint is None:
                poses[link] = IDENTITY
            else:
                poses[link] = poses[end(joint, 'parent')] @ joint.origin()
        return poses


def end(joint: Element, which: str) -> str:
    """Return the name of a joint's `parent` or `child` link, or nothing."""
    tag = joint.find(which)
    return tag.attributes.get('link', '') if tag is not None else ''
