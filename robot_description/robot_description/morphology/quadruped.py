# SPDX-License-Identifier: Apache-2.0
"""Recognises a quadruped by its tree and geometry, and compares it with the Go2."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
import math
import re

import numpy as np
from wasd_core.errors import DescriptionError
from wasd_core.rotations import Pose

from robot_description.morphology.leg import has_wheel, Leg, LEG_JOINTS, measure_leg, NotALeg
from robot_description.robot import Joint, Robot

WANTED = 'a quadruped is wanted: four legs of three revolute joints (roll, pitch, pitch)'
# More limbs than this are counted, not listed.
LISTED = 8
# Names that are an IMU's, the likeliest first; then any that has `imu` in it.
IMU_LINKS = ('imu', 'imu_link')
# The built-in Go2, for which everything is tuned: upper and lower leg [m], whole mass [kg].
GO2_LINK = 0.213
GO2_MASS = 16.086
# Its knees' motors: torque [N m] and no-load speed [rad/s].
GO2_TORQUE, GO2_SPEED = 35.55, 15.7
# Rotor inertia as a geared joint feels it [kg m^2]; unitree_mujoco's value for the Go2.
REFLECTED_INERTIA = 0.01
# A ratio closer to one than this is one: the last digits of a description say nothing.
RESOLUTION = 1e-4
# Poses keep away from the stops by this much [rad].
STOP_MARGIN = 0.05
# Thigh and calf of a Go2 on its belly with its legs folded [rad], where unitree_sdk2's stand
# example begins: it neither rocks on them nor are they in its own way.
FOLDED = (1.36, -2.65)
# Where a leg is and where its mirror image would be may differ by this share of its length.
MIRROR_SHARE = 0.1
# Powers of (length, mass) by which a unit grows on a robot that moves alike under the same
# gravity: time goes with the square root of length.
_POWERS = {
    'm': (1.0, 0.0),
    's': (0.5, 0.0),
    'kg': (0.0, 1.0),
    'N': (0.0, 1.0),
    'rad': (0.0, 0.0),
    '1': (0.0, 0.0),
}


class NotAQuadruped(DescriptionError):
    """
    The tree is not one of a quadruped; says what was found and what is wanted.

    `limbs` are the limbs by their first joint, each with why it is no leg, '' for one that is.
    """

    def __init__(self, message: str, limbs: Mapping[str, str] | None = None) -> None:
        super().__init__(message)
        self.limbs = dict(limbs or {})


@dataclass(frozen=True)
class Quadruped:
    """
    Four legs in the order front left, front right, rear left, rear right, and the trunk.

    `held` are the joints of what is no leg, a camera's or an arm's, and where they stay [rad] or
    [m]: at 0, or at the limit next to it. `passed` says of each such limb, by its first joint, why
    it is no leg.
    """

    trunk: tuple[str, ...]  # links that move as one with the base
    legs: tuple[Leg, ...]
    mass: float  # of the whole robot [kg]
    held: Mapping[str, float]
    passed: Mapping[str, str]

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

    @property
    def is_plain(self) -> bool:
        """Whether joint positions are leg angles as they are."""
        return bool((self.sign > 0.0).all()) and not self.zero.any()


def find_quadruped(robot: Robot) -> Quadruped:
    """
    Return the legs of a robot.

    Raises:
        NotAQuadruped: what was found instead.
    """
    groups = _rigid_groups(robot)
    limbs = _limbs(robot, groups)
    poses = poses_in_base(robot)
    legs, why = [], {}
    for limb in limbs:
        name = limb[0].name
        try:
            legs.append(measure_leg(robot, groups, poses, limb))
            why[name] = ''
        except NotALeg as reason:
            why[name] = str(reason)
    if len(legs) > 4:  # an arm on the back has no mirror image
        legs = [leg for leg in legs if any(_is_mirrored(leg, other) for other in legs)]
    if len(legs) != 4:
        called = _call(robot, groups, limbs)
        rolling = [limb for limb in limbs if has_wheel(robot, limb)]
        found = f'{called}found {_describe(limbs, why, rolling, robot.base)}'
        raise NotAQuadruped(f'{WANTED}; {found}', why)
    used = {leg.joints[0].name for leg in legs}
    others = [limb for limb in limbs if limb[0].name not in used]
    passed = {limb[0].name: why[limb[0].name] or 'no mirror image' for limb in others}
    held = {joint.name: robot.rest_positions[joint.name] for limb in others for joint in limb}
    return Quadruped(groups[robot.base], _in_order(legs), robot.mass, held, passed)


def _is_mirrored(leg: Leg, other: Leg) -> bool:
    """Whether a leg is where the mirror image of another is, and as long."""
    place, image = (each.hip + (0.0, each.offset, 0.0) for each in (leg, other))
    image[1] *= -1.0
    off = max(float(np.abs(place - image).max()), abs(leg.length - other.length))
    return leg is not other and off < MIRROR_SHARE * leg.length


def _call(robot: Robot, groups: dict[str, tuple[str, ...]], limbs: list[list[Joint]]) -> str:
    """Return what a robot is that has legs, but others: `six legs: `; '' for anything else."""
    rolling = [limb[-1].name for limb in limbs if has_wheel(robot, limb)]
    if rolling:
        return f'a robot with wheels at its feet ({", ".join(rolling)}) is none: '
    for limb in limbs:
        carried = groups[limb[0].child]
        if len(limb) > 2 * LEG_JOINTS and sum(joint.parent in carried for joint in limb) > 1:
            return f'{limb[0].name} bends the trunk between legs, make it fixed: '
    legs = sum(len(limb) in (2, 3, 4) for limb in limbs)
    return f'a robot with {legs} legs is none: ' if legs > 4 else ''


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


def _describe(
    limbs: list[list[Joint]], why: Mapping[str, str], rolling: list[list[Joint]], base: str
) -> str:
    if not limbs:
        return f'no movable joint on {base}'
    shown = ', '.join(
        f'{limb[0].name} ({_joints(len(limb) - 1)} and a wheel)'
        if limb in rolling
        else f'{limb[0].name} ({_joints(len(limb))})'
        for limb in limbs[:LISTED]
    )
    more = f' and {len(limbs) - LISTED} more' if len(limbs) > LISTED else ''
    text = f'{len(limbs)} limb{"s" if len(limbs) > 1 else ""} on {base}: {shown}{more}'
    # Each reason that the numbers do not tell, once, with the limb that has it first.
    told = [limb for limb in limbs if len(limb) == 3 or any(joint.mimics for joint in limb)]
    for limb in told:
        if why[limb[0].name]:
            return f'{text}; {limb[0].name} is no leg: {why[limb[0].name]}'
    return text


def _joints(count: int) -> str:
    return f'{count} joint{"s" if count > 1 else ""}'


def poses_in_base(robot: Robot) -> dict[str, Pose]:
    """Return where every link is in the base with all joints at zero."""
    poses = robot.zero_poses
    if not robot.is_fixed:
        return poses
    base = poses[robot.base]
    back = Pose(-base.rotation.T @ base.position, base.rotation.T)
    return {link: back @ pose for link, pose in poses.items()}


def find_imu(robot: Robot) -> str | None:
    """Return the link on the trunk that is an IMU by its name, or None."""
    trunk = _rigid_groups(robot)[robot.base]
    by_name = [link for link in IMU_LINKS if link in trunk]
    return next(iter([*by_name, *(link for link in trunk if 'imu' in link.lower())]), None)


def imu_position(robot: Robot) -> np.ndarray:
    """Return where the IMU is in the base (3,) [m]; its origin when the robot names none."""
    link = find_imu(robot)
    return np.zeros(3) if link is None else poses_in_base(robot)[link].position


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


@dataclass(frozen=True)
class Scale:
    """Leg length and mass of a robot as multiples of the Go2's."""

    length: float = 1.0
    mass: float = 1.0

    def of(self, unit: str) -> float:
        """
        Return how many times larger than on the Go2 a quantity is, by its unit.

        Dynamic similarity at equal gravity: 'm' grows with length, 's' with its square root,
        'N' with mass, and so everything made of them ('m/s', 'N m s/rad', '1/s^2').

        Raises:
            ValueError: the unit is made of something else.
        """
        length, mass = _dimension(unit)
        return float(self.length**length * self.mass**mass)


GO2 = Scale()


@cache
def _dimension(unit: str) -> tuple[float, float]:
    """Powers of (length, mass) of a unit, e.g. `N m s/rad` or `1/s^2`."""
    length = mass = 0.0
    above, _, below = unit.partition('/')
    for sign, product in ((1.0, above), (-1.0, below)):
        for factor in product.split():
            found = re.fullmatch(r'(\w+?)(?:\^(\d+))?', factor)
            if found is None or found[1] not in _POWERS:
                raise ValueError(f'unknown unit {factor!r}')
            power = sign * float(found[2] or 1)
            length += power * _POWERS[found[1]][0]
            mass += power * _POWERS[found[1]][1]
    return length, mass


def scale_of(quadruped: Quadruped) -> Scale:
    """Return how a robot compares with the Go2 in size and mass."""
    legs = [leg.length for leg in quadruped.legs]
    return Scale(_ratio(sum(legs) / len(legs), 2.0 * GO2_LINK), _ratio(quadruped.mass, GO2_MASS))


def _ratio(value: float, reference: float) -> float:
    ratio = value / reference
    return 1.0 if abs(ratio - 1.0) < RESOLUTION else ratio


def equip_legs(robot: Robot, quadruped: Quadruped) -> tuple[Robot, str]:
    """
    Return a robot with motors if its description speaks of none, and a line that says so.

    They are the Go2's knees', as large as the robot is. A robot of which one leg joint has a motor
    is returned as it is, with '': the others have none by intent, or by mistake.
    """
    if any(joint.effort > 0.0 for joint in quadruped.joints):
        return robot, ''
    scale = scale_of(quadruped)
    torque, speed = GO2_TORQUE * scale.of('N m'), GO2_SPEED * scale.of('rad/s')
    joints = {
        joint.name: replace(joint, effort=torque, velocity=joint.velocity or speed)
        for joint in quadruped.joints
    }
    line = (
        f'no leg joint has a motor: each gets one of {torque:.3g} N m and {speed:.3g} rad/s; '
        'give it <limit effort="..." velocity="..."/>'
    )
    return replace(robot, joints=robot.joints | joints), line


def similar_pose(quadruped: Quadruped, thigh: float, calf: float) -> np.ndarray:
    """
    Return leg angles (12,) [rad] with which a robot stands as the Go2 does with those given.

    The feet are as far below the trunk and beside their hips, in leg lengths, however the leg is
    divided; all are at one level. Knees that point forward get the mirror image. Angles keep away
    from the joints' stops; a knee that would not fold so far leaves the trunk higher.
    """
    legs = range(len(quadruped.legs))
    return np.concatenate([similar_leg(quadruped, leg, thigh, calf) for leg in legs])


def similar_leg(quadruped: Quadruped, number: int, thigh: float, calf: float) -> np.ndarray:
    """Angles (3,) of one leg of a `similar_pose`."""
    length, leg = scale_of(quadruped).length, quadruped.legs[number]
    # How high its thigh turns above the mean hip [m].
    middle = sum(float(leg.hip[2]) for leg in quadruped.legs) / len(quadruped.legs)
    raised = float(leg.hip[2]) - middle - leg.drop
    forward = -GO2_LINK * (math.sin(thigh) + math.sin(thigh + calf))
    down = GO2_LINK * (math.cos(thigh) + math.cos(thigh + calf))
    alike = _reach(GO2_LINK, GO2_LINK, forward, down)
    x, depth = length * forward, length * down + raised
    reached = _reach(leg.thigh, leg.calf, x, depth)
    # As differences, so that the Go2 gets exactly the angles that it was given.
    thigh, calf = thigh + (reached[0] - alike[0]), calf + (reached[1] - alike[1])
    low, high = leg.lower + STOP_MARGIN, leg.upper - STOP_MARGIN
    if leg.bend < 0.0:
        low, high = -high, -low  # of the mirror image
    if not low[2] <= calf <= high[2]:
        calf = min(max(calf, float(low[2])), float(high[2]))
        thigh = math.atan2(-x, depth) - _inner_angle(leg.thigh, leg.calf, calf)
    hip = min(max(0.0, float(leg.lower[0])), float(leg.upper[0]))
    thigh = min(max(thigh, float(low[1])), float(high[1]))
    return np.array((hip, leg.bend * thigh, leg.bend * calf))


def _reach(thigh: float, calf: float, forward: float, down: float) -> tuple[float, float]:
    """Thigh and calf angle [rad], knee backward, that bring the foot there or nearest to it."""
    nearest, farthest = abs(thigh - calf) + 1e-4, thigh + calf - 1e-4
    distance = min(max(math.hypot(forward, down), nearest), farthest)
    cosine = (distance**2 - thigh**2 - calf**2) / (2.0 * thigh * calf)
    knee = -math.acos(max(-1.0, min(1.0, cosine)))
    return math.atan2(-forward, down) - _inner_angle(thigh, calf, knee), knee


def _inner_angle(thigh: float, calf: float, knee: float) -> float:
    """Angle [rad] from the thigh to the line between hip and foot."""
    return math.atan2(calf * math.sin(knee), thigh + calf * math.cos(knee))
