# SPDX-License-Identifier: Apache-2.0
"""Masses and inertias as MuJoCo can take them; what no body can have is mended or refused."""

from collections.abc import Mapping

import mujoco
import numpy as np
from wasd_core.errors import DescriptionError
from wasd_core.rotations import NO_ORIGIN
from wasd_core.rotations import Origin

from robot_description.inertia import possible_inertia
from robot_description.mujoco.geoms import quaternion
from robot_description.urdf import Robot

# A link without mass between two joints, as a hip of three axes has, gets so much [kg], [kg m^2].
NEXT_TO_NOTHING = 1e-9


def add_masses(bodies: Mapping[str, mujoco.MjsBody], robot: Robot) -> None:
    """
    Give the links' bodies their masses and inertias, the nearest possible for an impossible one.

    Raises:
        DescriptionError: a joint moves nothing that has a mass.
    """
    virtual = _virtual_links(robot)
    for link in robot.links.values():
        if link.mass > 0.0:
            mended = possible_inertia(link.inertia, link.mass)
            inertia = link.inertia if mended is None else mended
            _set_mass(bodies[link.name], link.mass, inertia, link.inertial)
        elif link.name in virtual:
            inertia = NEXT_TO_NOTHING * np.eye(3)
            _set_mass(bodies[link.name], NEXT_TO_NOTHING, inertia, NO_ORIGIN)


def _set_mass(body: mujoco.MjsBody, mass: float, inertia: np.ndarray, frame: Origin) -> None:
    """Set a body's mass; MuJoCo finds the principal axes of the inertia in the frame by itself."""
    body.explicitinertial = True
    body.mass = mass
    body.ipos, body.iquat = frame.position, quaternion(frame)
    body.fullinertia = [*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]


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
