# SPDX-License-Identifier: Apache-2.0
"""One leg of a quadruped: its dimensions, its foot and the meaning of its joints."""

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np
from wasd_core.errors import DescriptionError
from wasd_core.rotations import Pose

from robot_description.robot import Joint
from robot_description.robot import Robot
from robot_description.robot import Shape

WANTED = 'a quadruped is wanted: four legs of three revolute joints (roll, pitch, pitch)'
# A description's rotations are often rounded to `1.57`: axes may be off by so much [rad].
AXIS_TOLERANCE = 0.01
# Angles and lengths below this are zero: [rad] and [m].
TINY = 1e-9
# A knee whose range is centred nearer to zero than this bends either way [rad].
NO_PREFERENCE = 0.1
FOOT_WORDS = ('foot', 'feet', 'toe', 'sole', 'ankle', 'tip')
# A foot is farther from the knee than this share of the thigh: a guard around the knee is none.
NEAREST_SHARE = 0.4
# A sphere whose centre is nearer to its link's frame than this share of its radius is meant to
# be there: Unitree's foot is drawn 2 mm off its frame.
CENTRED_SHARE = 0.5
# Radius of a foot whose shape does not say it, as a share of thigh plus lower leg.
USUAL_SHARE = 0.05


class NotAQuadruped(DescriptionError):
    """The tree is not one of a quadruped; says what was found and what is wanted."""


@dataclass(frozen=True)
class Leg:
    """
    One leg, seen from the base with the leg hanging straight down.

    `hip` (3,) [m] is where the hip axis passes the thigh's plane, in base axes; `offset` the
    signed distance to the left from that axis to the leg's plane, `drop` how far below it the
    thigh turns, `thigh` and `calf` the lengths of the links [m].

    Leg angles are zero when the leg hangs straight down, and positive about x at the hip and
    about y at thigh and calf; `sign` and `zero` (3,) turn joint positions into them:
    angle = sign * position + zero. `lower` and `upper` (3,) are limits of the angles [rad]. `bend`
    is +1 for a knee that points backward (negative calf angles), -1 for one that points forward.
    """

    joints: tuple[Joint, Joint, Joint]
    foot: str
    foot_centre: np.ndarray  # in the base at zero joint positions [m]
    hip: np.ndarray
    offset: float
    drop: float
    thigh: float
    calf: float
    foot_radius: float
    sign: np.ndarray
    zero: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    bend: float

    @property
    def length(self) -> float:
        """From the hip axis to the foot of the stretched leg [m]."""
        return self.drop + self.thigh + self.calf


def measure_leg(
    robot: Robot, groups: dict[str, tuple[str, ...]], poses: dict[str, Pose], limb: list[Joint]
) -> Leg:
    """
    Return a leg of three joints, `limb`.

    `groups` are for each link those that move as one with it, `poses` where they are in the base
    with all joints at zero.

    Raises:
        NotAQuadruped: it does not roll, pitch and pitch, or has no foot.
    """
    hip, thigh, calf = limb
    axes = [poses[joint.child].rotation @ joint.axis for joint in limb]
    left = _check_axes(limb, axes)
    at_hip, at_thigh, at_calf = (poses[joint.child].position for joint in limb)
    reach = float(np.linalg.norm(at_calf - at_thigh))
    foot = _find_foot(robot, groups[calf.child], poses, calf, reach)
    # The plane of the leg: forward is x, `left` its normal, `down` where it hangs.
    down = np.array((0.0, left[2], -left[1]))
    steps = (at_thigh - at_hip, at_calf - at_thigh, foot.centre - at_calf)
    (lead, drop), upper, lower = ((float(step[0]), float(step @ down)) for step in steps)
    thigh_length, calf_length = math.hypot(*upper), math.hypot(*lower)
    if not min(thigh_length, calf_length) > TINY:
        raise NotAQuadruped(f'{WANTED}; the leg of {hip.name!r} has no length')
    lean = math.atan2(-upper[0], upper[1])
    straight = (
        math.atan2(float(left[2]), float(left[1])),
        lean,
        math.atan2(-lower[0], lower[1]) - lean,
    )
    sign = np.array([1.0 if axes[0][0] > 0.0 else -1.0] + [np.sign(a @ left) for a in axes[1:]])
    zero, low, high = _angles(limb, sign, straight)
    return Leg(
        joints=(hip, thigh, calf),
        foot=foot.link,
        foot_centre=foot.centre,
        hip=at_hip + np.array((lead, 0.0, 0.0)),
        offset=sum(_snap(float(step @ left)) for step in steps),
        drop=_snap(drop),
        thigh=thigh_length,
        calf=calf_length,
        foot_radius=foot.radius,
        sign=sign,
        zero=zero,
        lower=low,
        upper=high,
        bend=-1.0 if _middle(low[2], high[2]) > NO_PREFERENCE else 1.0,
    )


def _check_axes(limb: list[Joint], axes: list[np.ndarray]) -> np.ndarray:
    """
    Return the normal of a leg's plane, (3,), to the left.

    Raises:
        NotAQuadruped: the joints do not roll, pitch and pitch.
    """
    roll, pitch, knee = axes
    cosine = math.cos(AXIS_TOLERANCE)
    is_right = (
        abs(roll[0]) > cosine
        and abs(pitch[0]) < math.sin(AXIS_TOLERANCE)
        and abs(float(pitch @ knee)) > cosine
    )
    if not is_right:
        turns = ', '.join(
            f'{joint.name} about ({" ".join(f"{part:.3g}" for part in axis)})'
            for joint, axis in zip(limb, axes, strict=True)
        )
        raise NotAQuadruped(
            f'{WANTED}: the first about x, forward, the others both across it; found {turns}'
        )
    left = np.array((0.0, pitch[1], pitch[2]))
    left /= np.linalg.norm(left)
    return left if left[1] > 0.0 else -left


def _angles(
    limb: list[Joint], sign: np.ndarray, straight: tuple[float, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the leg angles at zero joint positions, and their limits, each (3,) [rad]."""
    zero, low, high = np.zeros(3), np.zeros(3), np.zeros(3)
    for index, joint in enumerate(limb):
        ends = sorted((sign[index] * joint.lower, sign[index] * joint.upper))
        # Of the angles that mean the same, the first whose range is around zero.
        turned = (straight[index] + 2.0 * math.pi * turns for turns in (0, 1, -1, 2, -2))
        zero[index] = _snap(max(turned, key=lambda angle: _overlap(ends, angle)))
        low[index], high[index] = ends[0] + zero[index], ends[1] + zero[index]
    return zero, low, high


def _overlap(ends: list[float], angle: float) -> float:
    """How much of a range, moved by `angle`, is within half a turn of zero; 1 rad is enough."""
    return min(1.0, min(ends[1] + angle, math.pi) - max(ends[0] + angle, -math.pi))


def _middle(lower: float, upper: float) -> float:
    """Middle of a range; 0 of one without ends."""
    return 0.5 * (lower + upper) if math.isfinite(lower) and math.isfinite(upper) else 0.0


def _snap(value: float) -> float:
    return 0.0 if abs(value) < TINY else value


@dataclass(frozen=True)
class Foot:
    """The link that touches the ground, and its ball in the base's axes at zero joints [m]."""

    link: str
    centre: np.ndarray
    radius: float


def _find_foot(
    robot: Robot, links: Sequence[str], poses: dict[str, Pose], joint: Joint, thigh: float
) -> Foot:
    """
    Return the foot of a lower leg.

    `links` are the links of the lower leg, `poses` theirs in the base at zero joints, `joint` is
    what turns it and `thigh` [m] how long the upper leg is. In this order: the farthest sphere,
    the farthest link named like a foot, the far end of the farthest shape.

    Raises:
        NotAQuadruped: there is nothing like one.
    """
    knee = poses[joint.child].position
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
    raise NotAQuadruped(
        f'no foot below joint {joint.name!r}: {", ".join(links)} need a sphere to collide '
        'with, or a fixed link named foot at the end'
    )


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
