# SPDX-License-Identifier: Apache-2.0
"""URDF to Pinocchio: the same joints as in MuJoCo, found by name."""

from collections.abc import Mapping
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin

from robot_description.errors import DescriptionError
from robot_description.mujoco_model import ROOT_JOINT
from robot_description.plain_urdf import plain_urdf
from robot_description.urdf import MOVABLE
from robot_description.urdf import Robot

# All that kinematics and dynamics need.
KEPT = {
    'link': {'inertial'},
    'joint': {'origin', 'parent', 'child', 'axis', 'limit', 'dynamics'},
}
# A joint without limits goes as far as anybody will ask for.
NO_LIMIT = {'lower': '-1e9', 'upper': '1e9', 'effort': '0', 'velocity': '0'}


def to_pinocchio(urdf: str, robot: Robot) -> pin.Model:
    """
    Return the robot as a Pinocchio model, free to move unless it hangs on a link called `world`.

    `robot` is the parsed `urdf`. Every link is a frame of its name; joints keep theirs, and the
    free one is called as in MuJoCo. Pinocchio sorts brothers by name: go by `configuration`, not
    by position in the file.

    Raises:
        DescriptionError: what Pinocchio says about the URDF, in one line.
    """
    text = bare_urdf(urdf)
    try:
        if robot.is_fixed:
            return pin.buildModelFromXML(text)
        return pin.buildModelFromXML(text, pin.JointModelFreeFlyer(), ROOT_JOINT)
    except (ValueError, RuntimeError) as error:
        raise DescriptionError(f'Pinocchio: {" ".join(str(error).split())}') from None


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


def bare_urdf(urdf: str) -> str:
    """
    Return the URDF without shapes, materials and tags, which urdfdom has complaints about.

    It also wants a name for the robot and all of a limit for joints that may have one.
    """
    tree = plain_urdf(urdf)
    tree.set('name', tree.get('name') or 'robot')
    for element in list(tree):
        if element.tag not in KEPT:
            tree.remove(element)
            continue
        if element.get('type') in MOVABLE:
            limit = element.find('limit')
            if limit is None:
                limit = ElementTree.SubElement(element, 'limit')
            limit.attrib.update({**NO_LIMIT, **limit.attrib})
        for child in list(element):
            if child.tag not in KEPT[element.tag] or _is_weightless(child):
                element.remove(child)
    return ElementTree.tostring(tree, encoding='unicode')


def _is_weightless(tag: ElementTree.Element) -> bool:
    """Whether it is an inertial without all of its parts, for which urdfdom refuses the file."""
    parts = [tag.find(part) for part in ('mass', 'inertia')]
    return tag.tag == 'inertial' and any(part is None for part in parts)
