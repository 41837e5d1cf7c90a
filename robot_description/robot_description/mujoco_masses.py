# SPDX-License-Identifier: Apache-2.0
"""Masses and inertias as MuJoCo can take them; what no body can have is mended or refused."""

import xml.etree.ElementTree as ElementTree

import numpy as np

from robot_description.errors import DescriptionError
from robot_description.inertia import possible_inertia
from robot_description.urdf import INERTIA_COMPONENTS
from robot_description.urdf import Robot

# A link without mass between two joints, as a hip of three axes has, gets so much [kg], [kg m^2].
NEXT_TO_NOTHING = 1e-9


def mend_inertials(tree: ElementTree.Element, robot: Robot) -> None:
    """
    Mend the inertials of a URDF tree for MuJoCo: the nearest possible for an impossible one.

    `robot` is the parsed tree.

    Raises:
        DescriptionError: a joint moves nothing that has a mass.
    """
    virtual = _virtual_links(robot)
    for tag in tree.findall('link'):
        link = robot.links[tag.get('name', '')]
        inertial = tag.find('inertial')
        if link.mass > 0.0 and inertial is not None:
            better = possible_inertia(link.inertia, link.mass)
            if better is not None:
                _write_inertia(inertial, better)
            continue
        if inertial is not None:
            tag.remove(inertial)
        if link.name in virtual:
            inertial = ElementTree.SubElement(tag, 'inertial')
            ElementTree.SubElement(inertial, 'mass', value=str(NEXT_TO_NOTHING))
            _write_inertia(inertial, NEXT_TO_NOTHING * np.eye(3))


def _write_inertia(inertial: ElementTree.Element, inertia: np.ndarray) -> None:
    tag = inertial.find('inertia')
    if tag is None:
        tag = ElementTree.SubElement(inertial, 'inertia')
    for component, value in zip(INERTIA_COMPONENTS, inertia[np.triu_indices(3)], strict=True):
        tag.set(component, repr(float(value)))


def _virtual_links(robot: Robot) -> set[str]:
    """
    Return the links that move without a mass of their own, with one further out.

    Raises:
        DescriptionError: there is a link that moves without any.
    """
    welded = dict.fromkeys(robot.links, 0.0)
    beyond = dict(welded)
    for link in reversed(robot.links_from_root):
        mass = robot.links[link].mass
        welded[robot.carriers[link]] += mass
        beyond[link] += mass
        if link != robot.root:
            beyond[robot.parent_joints[link].parent] += beyond[link]
    virtual = set()
    for link in robot.links_from_root:
        joint = robot.parent_joints.get(link)
        stays = robot.carriers[link] != link or joint is None and robot.is_fixed
        if stays or welded[link] > 0.0:
            continue
        if beyond[link] <= 0.0:
            by = f' (joint {joint.name!r})' if joint is not None else ''
            has = f'a mass of {beyond[link]:g} kg' if beyond[link] else 'no mass'
            raise DescriptionError(
                f'link {link!r} moves{by} but has {has}: '
                'give it an <inertial> with <mass> and <inertia>'
            )
        virtual.add(link)
    return virtual
