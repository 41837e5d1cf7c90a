# SPDX-License-Identifier: Apache-2.0
"""Finds where a leg touches the ground: a sphere, a foot link, or the end of the lower leg."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from wasd_core.rotations import Pose

from robot_description.urdf import Robot
from robot_description.urdf_shapes import Shape

FOOT_WORDS = ('foot', 'feet', 'toe', 'sole', 'ankle', 'tip')
# A foot is farther from the knee than this share of the thigh: a guard around the knee is none.
NEAREST_SHARE = 0.4
# A sphere whose centre is nearer to its link's frame than this share of its radius is meant to
# be there: Unitree's foot is drawn 2 mm off its frame.
CENTRED_SHARE = 0.5
# Radius of a foot whose shape does not say it, as a share of thigh plus lower leg.
USUAL_SHARE = 0.05


@dataclass(frozen=True)
class Foot:
    """The link that touches the ground, and its ball in the base's axes at zero joints [m]."""

    link: str
    centre: np.ndarray
    radius: float


def find_foot(
    robot: Robot, links: Sequence[str], poses: dict[str, Pose], knee: np.ndarray, thigh: float
) -> Foot | None:
    """
    Return the foot of a lower leg, or None where there is nothing like one.

    `links` are the links of the lower leg, `poses` theirs in the base at zero joints, `knee` (3,)
    is where it turns and `thigh` [m] how long the upper leg is. In this order: the farthest
    sphere, the farthest link named like a foot, the far end of the farthest shape.
    """
    candidates = (
        _spheres(robot, links, poses),
        _named(links, poses),
        [foot for link in links for foot in _ends(robot, link, poses[link], knee)],
    )
    for feet in candidates:
        far = [foot for foot in feet if _distance(foot, knee) > NEAREST_SHARE * thigh]
        if far:
            foot = max(far, key=lambda foot: _distance(foot, knee))
            radius = foot.radius or USUAL_SHARE * (thigh + _distance(foot, knee))
            return Foot(foot.link, foot.centre, radius)
    return None


def _distance(foot: Foot, knee: np.ndarray) -> float:
    return float(np.linalg.norm(foot.centre - knee))


def _spheres(robot: Robot, links: Sequence[str], poses: dict[str, Pose]) -> list[Foot]:
    feet = []
    for link in links:
        for shape in robot.links[link].collisions:
            if shape.kind == 'sphere':
                radius = shape.size[0]
                offset = float(np.linalg.norm(shape.pose.position))
                is_centred = offset < CENTRED_SHARE * radius
                place = poses[link] if is_centred else poses[link] @ shape.pose
                feet.append(Foot(link, place.position, radius))
    return feet


def _named(links: Sequence[str], poses: dict[str, Pose]) -> list[Foot]:
    named = [link for link in links if any(word in link.lower() for word in FOOT_WORDS)]
    return [Foot(link, poses[link].position, 0.0) for link in named]


def _ends(robot: Robot, link: str, pose: Pose, knee: np.ndarray) -> list[Foot]:
    """Return balls that fit into the far ends of a link's boxes and cylinders."""
    feet = []
    for shape in robot.links[link].collisions:
        half = _half_sizes(shape)
        if half is None:
            continue
        place = pose @ shape.pose
        axis = int(np.argmax(half))
        radius = float(np.median(half)) if shape.kind == 'box' else float(half[0])
        reach = (float(half[axis]) - radius) * place.rotation[:, axis]
        ends = (place.position + reach, place.position - reach)
        far = max(ends, key=lambda end: float(np.linalg.norm(end - knee)))
        feet.append(Foot(link, far, radius))
    return feet


def _half_sizes(shape: Shape) -> np.ndarray | None:
    """Return half of a box's or cylinder's extents along its own axes, shape (3,) [m]."""
    if shape.kind == 'box':
        return 0.5 * np.array(shape.size)
    if shape.kind == 'cylinder':
        radius, length = shape.size
        return np.array((radius, radius, 0.5 * length))
    return None
