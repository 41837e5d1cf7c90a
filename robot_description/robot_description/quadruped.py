# SPDX-License-Identifier: Apache-2.0
"""Recognises a quadruped by its tree and geometry, whatever its links and joints are called."""

from dataclasses import dataclass
import math

import numpy as np

from robot_description.errors import DescriptionError
from robot_description.foot import find_foot
from robot_description.pose import Pose
from robot_description.urdf import Joint
from robot_description.urdf import Robot

WANTED = 'a quadruped is wanted: four legs of three revolute joints (roll, pitch, pitch)'
# A description's rotations are often rounded to `1.57`: axes may be off by so much [rad].
AXIS_TOLERANCE = 0.01
# Angles and lengths below this are zero: [rad] and [m].
TINY = 1e-9
# A knee whose range is centred nearer to zero than this bends either way [rad].
NO_PREFERENCE = 0.1
# More limbs than this are counted, not listed.
LISTED = 8


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


@dataclass(frozen=True)
class Quadruped:
    """Four legs in the order front left, front right, rear left, rear right, and the trunk."""

    trunk: tuple[str, ...]  # links that move as one with the base
    legs: tuple[Leg, ...]
    mass: float  # of the whole robot [kg]

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The twelve joints, leg by leg: hip, thigh, calf."""
        return tuple(joint for leg in self.legs for joint in leg.joints)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the twelve joints, leg by leg."""
        return tuple(joint.name for joint in self.joints)

    @property
    def feet(self) -> tuple[str, ...]:
        """The links that touch the ground."""
        return tuple(leg.foot for leg in self.legs)

    @property
    def sign(self) -> np.ndarray:
        """Direction of each joint, shape (12,)."""
        return np.concatenate([leg.sign for leg in self.legs])

    @property
    def zero(self) -> np.ndarray:
        """Leg angles at zero joint positions, shape (12,) [rad]."""
        return np.concatenate([leg.zero for leg in self.legs])


def find_quadruped(robot: Robot) -> Quadruped:
    """
    Return the legs of a robot.

    Raises:
        NotAQuadruped: what was found instead.
    """
    groups = _rigid_groups(robot)
    trunk = groups[robot.base]
    limbs = _limbs(robot, groups)
    if len(limbs) != 4 or any(not _is_leg(limb) for limb in limbs):
        raise NotAQuadruped(f'{WANTED}; found {_describe(limbs, robot.base)}')
    poses = poses_in_base(robot)
    legs = [_leg(robot, groups, poses, limb) for limb in limbs]
    return Quadruped(trunk, _in_order(legs), robot.mass)


def links_on_trunk(robot: Robot) -> tuple[str, ...]:
    """Return the links that move as one with the base."""
    return _rigid_groups(robot)[robot.base]


def _rigid_groups(robot: Robot) -> dict[str, tuple[str, ...]]:
    """Return for each link the links that move as one with it."""
    members: dict[str, list[str]] = {}
    for link, carrier in robot.carriers.items():
        members.setdefault(carrier, []).append(link)
    return {link: tuple(members[carrier]) for link, carrier in robot.carriers.items()}


def _limbs(robot: Robot, groups: dict[str, tuple[str, ...]]) -> list[list[Joint]]:
    """Return what hangs on the trunk, each limb with all its joints, from the trunk on."""

    def below(links: tuple[str, ...]) -> list[Joint]:
        return [joint for joint in robot.movable_joints if joint.parent in links]

    def subtree(joint: Joint) -> list[Joint]:
        further = [subtree(child) for child in below(groups[joint.child])]
        return [joint, *(found for branch in further for found in branch)]

    return [subtree(joint) for joint in below(groups[robot.base])]


def _is_leg(limb: list[Joint]) -> bool:
    """Whether a limb is a chain of three turning joints."""
    is_turning = all(joint.kind != 'prismatic' for joint in limb)
    # In a chain no two joints begin on links that move as one; with three joints in all, a
    # branch would need two joints below one.
    return len(limb) == 3 and is_turning and len({joint.parent for joint in limb}) == 3


def _describe(limbs: list[list[Joint]], base: str) -> str:
    if not limbs:
        return f'no movable joint on {base}'
    shown = ', '.join(
        f'{limb[0].name} ({len(limb)} joint{"s" if len(limb) > 1 else ""})'
        for limb in limbs[:LISTED]
    )
    more = f' and {len(limbs) - LISTED} more' if len(limbs) > LISTED else ''
    text = f'{len(limbs)} limb{"s" if len(limbs) > 1 else ""} on {base}: {shown}{more}'
    if sum(_is_leg(limb) for limb in limbs) == 4:
        text += '; make the joints of what is no leg fixed'
    return text


def poses_in_base(robot: Robot) -> dict[str, Pose]:
    """Return where every link is in the base with all joints at zero."""
    poses = {link: robot.pose_of(link) for link in robot.links}
    if not robot.is_fixed:
        return poses
    base = poses[robot.base]
    back = Pose(-base.rotation.T @ base.position, base.rotation.T)
    return {link: back @ pose for link, pose in poses.items()}


def _leg(
    robot: Robot, groups: dict[str, tuple[str, ...]], poses: dict[str, Pose], limb: list[Joint]
) -> Leg:
    hip, thigh, calf = limb
    axes = [poses[joint.child].rotation @ joint.axis for joint in limb]
    left = _check_axes(limb, axes)
    at_hip, at_thigh, at_calf = (poses[joint.child].position for joint in limb)
    lower_leg = groups[calf.child]
    foot = find_foot(robot, lower_leg, poses, at_calf, float(np.linalg.norm(at_calf - at_thigh)))
    if foot is None:
        raise NotAQuadruped(
            f'no foot below joint {calf.name!r}: {", ".join(lower_leg)} need a sphere to collide '
            'with, or a fixed link named foot at the end'
        )
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


def _in_order(legs: list[Leg]) -> tuple[Leg, ...]:
    """
    Return the legs as front left, front right, rear left, rear right, by where their hips are.

    Raises:
        NotAQuadruped: they are not at the corners of a rectangle, more or less.
    """
    hips = np.array([leg.hip + (0.0, leg.offset, 0.0) for leg in legs])
    centre = hips.mean(axis=0)
    corners: dict[tuple[bool, bool], Leg] = {}
    for leg, hip in zip(legs, hips, strict=True):
        corners[bool(hip[0] > centre[0]), bool(hip[1] > centre[1])] = leg
    if len(corners) != 4:
        places = ', '.join(
            f'{leg.joints[0].name} ({x:.2f} {y:.2f})'
            for leg, (x, y, _) in zip(legs, hips.tolist(), strict=True)
        )
        raise NotAQuadruped(f'{WANTED}, one at each corner, x forward; found hips {places}')
    return tuple(
        corners[key] for key in ((True, True), (True, False), (False, True), (False, False))
    )
