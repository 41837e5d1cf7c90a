# SPDX-License-Identifier: Apache-2.0
"""URDF to Pinocchio: the same joints as in MuJoCo, found by name."""

from collections.abc import Collection, Mapping
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin
from wasd_core.errors import DescriptionError
from wasd_core.errors import one_line

from robot_description.description import Description
from robot_description.robot import MOVABLE
from robot_description.robot import ROOT_JOINT
from robot_description.robot import WORLD_LINK
from robot_description.urdf import INERTIA_COMPONENTS

# All that kinematics and dynamics need.
KEPT = {
    'link': {'inertial'},
    'joint': {'origin', 'parent', 'child', 'axis', 'limit', 'dynamics'},
}
INERTIAL_PARTS = ('origin', 'mass', 'inertia')
# A joint without limits goes as far as anybody will ask for.
NO_LIMIT = {'lower': '-1e9', 'upper': '1e9', 'effort': '0', 'velocity': '0'}


def to_pinocchio(description: Description, *, for_control: bool = False) -> pin.Model:
    """
    Return the robot as a Pinocchio model, free to move unless it hangs on a link called `world`.

    Every link is a frame of its name; joints keep theirs, and the free one is called as in MuJoCo.
    Pinocchio sorts brothers by name: go by `configuration`, not by position in the file.

    With `for_control` it is free in any case, and a joint without limits is an angle like others
    instead of a cosine and a sine.

    Raises:
        DescriptionError: what Pinocchio says about the URDF, in one line.
    """
    text = bare_urdf(description.urdf, for_control)
    try:
        if description.robot.is_fixed and not for_control:
            return pin.buildModelFromXML(text)
        return pin.buildModelFromXML(text, pin.JointModelFreeFlyer(), ROOT_JOINT)
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


def bare_urdf(urdf: str, for_control: bool = False) -> str:
    """
    Return the URDF without shapes, materials and tags, which urdfdom has complaints about.

    Of repeated tags the first counts, as for `parse_urdf`; what is left out is URDF's default.
    urdfdom also wants a name for the robot and all of a limit for joints that may have one. What
    `for_control` changes is said at `to_pinocchio`.
    """
    tree = ElementTree.fromstring(urdf)
    tree.set('name', tree.get('name') or 'robot')
    for element in list(tree):
        if element.tag not in KEPT or (for_control and _is_world(element)):
            tree.remove(element)
            continue
        _keep_first(element, KEPT[element.tag])
        if element.tag == 'joint':
            if for_control and element.get('type') == 'continuous':
                _bound(element)
            _complete_joint(element)
        elif (inertial := element.find('inertial')) is not None:
            _keep_first(inertial, INERTIAL_PARTS)
            _complete_inertial(element, inertial)
    return ElementTree.tostring(tree, encoding='unicode')


def _keep_first(element: ElementTree.Element, tags: Collection[str]) -> None:
    """Leave the first child of each of these tags."""
    first = {tag: element.find(tag) for tag in tags}
    for child in list(element):
        if child is not first.get(child.tag):
            element.remove(child)


def _is_world(element: ElementTree.Element) -> bool:
    """Whether an element is the link `world` or a joint that holds the robot on it."""
    if element.tag == 'link':
        return element.get('name') == WORLD_LINK
    parent = element.find('parent')
    return parent is not None and parent.get('link') == WORLD_LINK


def _bound(joint: ElementTree.Element) -> None:
    """Make a joint without stops one with stops that it never meets."""
    joint.set('type', 'revolute')
    limit = joint.find('limit')
    if limit is None:
        limit = ElementTree.SubElement(joint, 'limit')
    limit.attrib.update({end: NO_LIMIT[end] for end in ('lower', 'upper')})


def _complete_joint(joint: ElementTree.Element) -> None:
    joint.set('type', joint.get('type', 'fixed'))
    is_movable = joint.get('type') in MOVABLE
    axis, limit = joint.find('axis'), joint.find('limit')
    if axis is not None and not (is_movable and 'xyz' in axis.attrib):
        joint.remove(axis)
    if limit is not None and float(limit.get('lower', '0')) == float(limit.get('upper', '0')):
        limit.attrib.pop('lower', None)  # a limit of no width is none
        limit.attrib.pop('upper', None)
    if is_movable:
        if limit is None:
            limit = ElementTree.SubElement(joint, 'limit')
        limit.attrib.update({**NO_LIMIT, **limit.attrib})


def _complete_inertial(link: ElementTree.Element, inertial: ElementTree.Element) -> None:
    """Say what is left out of an inertial; without a part urdfdom refuses the file: drop it."""
    mass, inertia = inertial.find('mass'), inertial.find('inertia')
    if mass is None or inertia is None:
        link.remove(inertial)
        return
    mass.set('value', mass.get('value', '0'))
    for component in INERTIA_COMPONENTS:
        inertia.set(component, inertia.get(component, '0'))
