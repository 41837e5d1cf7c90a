# SPDX-License-Identifier: Apache-2.0
"""URDF to Pinocchio: the same joints as in MuJoCo, found by name."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin
from wasd_core.errors import DescriptionError, one_line
from wasd_core.rotations import Pose

from robot_description.description import Description
from robot_description.robot import Link, MOVABLE
from robot_description.urdf import INERTIA_COMPONENTS

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
    text = bare_urdf(description, for_control, fixed)
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
    description: Description,
    for_control: bool = False,
    fixed: Mapping[str, Pose] = MappingProxyType({}),
) -> str:
    """
    Return the URDF without shapes, materials and tags, which urdfdom has complaints about.

    Links and joints are those of `description.robot`, masses and inertias, too. Of repeated tags
    the first counts, as for `parse_urdf`; what is left out is URDF's default. urdfdom also wants a
    name for the robot and all of a limit for joints that may have one. What `for_control` changes
    is said at `to_pinocchio`; `fixed` joints are so, with these poses.
    """
    robot, source = description.robot, ElementTree.fromstring(description.urdf)
    links, joints = robot.links, robot.joints
    world = robot.root if for_control and robot.is_fixed else None
    bare = ElementTree.Element('robot', name=source.get('name') or 'robot')
    for element in source:
        name = element.get('name', '')
        if element.tag == 'link' and name in links and name != world:
            _add_link(bare, links[name])
        elif element.tag == 'joint' and name in joints and joints[name].parent != world:
            if name in fixed:
                _add_fixed_joint(bare, element, fixed[name])
            else:
                _add_joint(bare, element, for_control)
    return ElementTree.tostring(bare, encoding='unicode')


def _add_link(robot: ElementTree.Element, link: Link) -> None:
    """Add a link with its inertial, if it has a mass."""
    bare = ElementTree.SubElement(robot, 'link', name=link.name)
    if link.mass == 0.0:
        return
    inertial = ElementTree.SubElement(bare, 'inertial')
    _add_origin(inertial, link.inertial.position, link.inertial.rpy)
    ElementTree.SubElement(inertial, 'mass', value=repr(link.mass))
    moments = map(repr, link.inertia[np.triu_indices(3)].tolist())
    ElementTree.SubElement(
        inertial, 'inertia', dict(zip(INERTIA_COMPONENTS, moments, strict=True))
    )


def _add_origin(element: ElementTree.Element, xyz: Iterable[float], rpy: Iterable[float]) -> None:
    """Add a pose: a position [m], and roll, pitch and yaw [rad]."""
    text = {
        key: ' '.join(map(repr, map(float, part))) for key, part in (('xyz', xyz), ('rpy', rpy))
    }
    ElementTree.SubElement(element, 'origin', text)


def _add_fixed_joint(robot: ElementTree.Element, joint: ElementTree.Element, pose: Pose) -> None:
    """Add a joint as if it were fixed with its child at a pose in its parent."""
    bare = ElementTree.SubElement(robot, 'joint', {**joint.attrib, 'type': 'fixed'})
    bare.extend(part for part in joint if part.tag in ('parent', 'child'))
    _add_origin(bare, pose.position, pin.rpy.matrixToRpy(pose.rotation))


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
