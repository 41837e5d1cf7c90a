# SPDX-License-Identifier: Apache-2.0
"""URDF to Pinocchio: the same joints as in MuJoCo, found by name."""

from collections.abc import Mapping
from types import MappingProxyType
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin
from wasd_core.errors import DescriptionError, one_line
from wasd_core.rotations import Pose

from robot_description.description import Description
from robot_description.robot import Link, MOVABLE, WORLD_LINK
from robot_description.urdf import INERTIA_COMPONENTS

# What an inertial is made of, and what is left out of it.
INERTIAL_PARTS = ('origin', 'mass', 'inertia')
ZEROS = {'mass': {'value': '0'}, 'inertia': dict.fromkeys(INERTIA_COMPONENTS, '0')}
# A joint without limits goes as far as anybody will ask for.
NO_LIMIT = {'lower': '-1e9', 'upper': '1e9', 'effort': '0', 'velocity': '0'}


def to_pinocchio(
    description: Description,
    *,
    for_control: bool = False,
    held: Mapping[str, float] = MappingProxyType({}),
) -> pin.Model:
    """
    Return the robot as a Pinocchio model, free to move unless it hangs on a link called `world`.

    Every link is a frame of its name; joints keep theirs, and the free one is called as in MuJoCo.
    Pinocchio sorts brothers by name: go by `configuration`, not by position in the file.

    With `for_control` it is free in any case, and a joint without limits is an angle like others
    instead of a cosine and a sine. Joints that are `held` [rad] or [m] are fixed there.

    Raises:
        DescriptionError: what Pinocchio says about the URDF, in one line.
    """
    joints = description.robot.joints
    fixed = {name: joints[name].transform(position) for name, position in held.items()}
    links = description.robot.links if for_control else {}
    text = bare_urdf(description.urdf, for_control, fixed, links)
    try:
        if description.robot.is_fixed and not for_control:
            return pin.buildModelFromXML(text)
        return pin.buildModelFromXML(text, pin.JointModelFreeFlyer(), description.robot.root_joint)
    except (ValueError, RuntimeError) as error:
        raise DescriptionError(f'Pinocchio: {one_line(error)}') from None


def configuration(model: pin.Model, positions: Mapping[str, float]) -> np.ndarray:
    """
    Return the configuration q, shape (nq,), with joints at positions [rad] or [m]; others at 0.

    A joint without limits takes two numbers in it, cosine and sine.
    """
    q = pin.neutral(model)
    for name, position in positions.items():
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 2:
            q[joint.idx_q : joint.idx_q + 2] = np.cos(position), np.sin(position)
        else:
            q[joint.idx_q] = position
    return np.array(q)


def link_positions(model: pin.Model, q: np.ndarray) -> dict[str, np.ndarray]:
    """Return where the frame of each link is in the root's [m], each of shape (3,)."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return {
        frame.name: data.oMf[index].translation.copy()
        for index, frame in enumerate(model.frames)
        if frame.type == pin.FrameType.BODY
    }


def bare_urdf(
    urdf: str,
    for_control: bool = False,
    fixed: Mapping[str, Pose] = MappingProxyType({}),
    links: Mapping[str, Link] = MappingProxyType({}),
) -> str:
    """
    Return the URDF without shapes, materials and tags, which urdfdom has complaints about.

    Of repeated tags the first counts, as for `parse_urdf`; what is left out is URDF's default.
    urdfdom also wants a name for the robot and all of a limit for joints that may have one. What
    `for_control` changes is said at `to_pinocchio`; `fixed` joints are so, with these poses,
    and `links` have the inertias that they have there.
    """
    source = ElementTree.fromstring(urdf)
    bare = ElementTree.Element('robot', name=source.get('name') or 'robot')
    for element in source:
        if element.tag == 'link' and not (for_control and element.get('name') == WORLD_LINK):
            _add_link(bare, element, links.get(element.get('name', '')))
        elif element.tag == 'joint' and not (for_control and _hangs_on_world(element)):
            name = element.get('name', '')
            if name in fixed:
                _add_fixed_joint(bare, element, fixed[name])
            else:
                _add_joint(bare, element, for_control)
    return ElementTree.tostring(bare, encoding='unicode')


def _add_link(robot: ElementTree.Element, link: ElementTree.Element, known: Link | None) -> None:
    """Add a link with its inertial, if that has all parts: else urdfdom refuses the file."""
    bare = ElementTree.SubElement(robot, 'link', link.attrib)
    inertial = link.find('inertial')
    parts = [inertial.find(tag) for tag in INERTIAL_PARTS] if inertial is not None else []
    if not parts or None in parts[1:]:
        return
    into = ElementTree.SubElement(bare, 'inertial')
    for tag, part in zip(INERTIAL_PARTS, parts, strict=True):
        if part is not None:
            attributes = {**ZEROS.get(tag, {}), **part.attrib}
            if tag == 'inertia' and known is not None:
                upper = known.inertia[np.triu_indices(3)].tolist()
                attributes = dict(zip(INERTIA_COMPONENTS, map(repr, upper), strict=True))
            ElementTree.SubElement(into, tag, attributes)


def _hangs_on_world(joint: ElementTree.Element) -> bool:
    """Whether a joint holds the robot on the link `world`."""
    parent = joint.find('parent')
    return parent is not None and parent.get('link') == WORLD_LINK


def _add_fixed_joint(robot: ElementTree.Element, joint: ElementTree.Element, pose: Pose) -> None:
    """Add a joint as if it were fixed with its child at a pose in its parent."""
    bare = ElementTree.SubElement(robot, 'joint', {**joint.attrib, 'type': 'fixed'})
    bare.extend(part for part in joint if part.tag in ('parent', 'child'))
    place, turn = pose.position, pin.rpy.matrixToRpy(pose.rotation)
    text = {
        key: ' '.join(map(repr, map(float, part))) for key, part in (('xyz', place), ('rpy', turn))
    }
    ElementTree.SubElement(bare, 'origin', text)


def _add_joint(robot: ElementTree.Element, joint: ElementTree.Element, bounded: bool) -> None:
    """Add a joint; `bounded` gives one without stops some that it never meets."""
    kind = joint.get('type', 'fixed')
    is_movable, has_stops = kind in MOVABLE, not (bounded and kind == 'continuous')
    bare = ElementTree.SubElement(robot, 'joint', joint.attrib)
    bare.set('type', kind if has_stops else 'revolute')
    for tag in ('origin', 'parent', 'child', 'axis', 'dynamics'):
        part = joint.find(tag)
        if part is not None and (tag != 'axis' or is_movable and 'xyz' in part.attrib):
            bare.append(part)
    limit = joint.find('limit')
    said = dict(limit.attrib) if limit is not None else {}
    if not has_stops or not any(float(said.get(end, '0')) for end in ('lower', 'upper')):
        for end in ('lower', 'upper'):  # limits of zero are none
            said.pop(end, None)
    if is_movable or limit is not None:
        ElementTree.SubElement(bare, 'limit', {**NO_LIMIT, **said} if is_movable else said)
