# SPDX-License-Identifier: Apache-2.0
"""One leg of a quadruped: its dimensions, its foot and the meaning of its joints."""

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np
from wasd_core.rotations import Pose

from robot_description.meshes.load import mesh_points
from robot_description.robot import Joint, Robot, Shape

LEG_JOINTS = 3
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
# The end of a mesh is so much of the lower leg, and its ball has at most such a radius.
TIP_SHARE, MOST_SHARE = 0.05, 0.15


class NotALeg(Exception):
    """A limb is no leg that can be walked on; says why, without the limb's name."""


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
    Return the leg that a limb is: all joints of `limb`, from the trunk on.

    `groups` are for each link those that move as one with it, `poses` where they are in the base
    with all joints at zero.

    Raises:
        NotALeg: it is no chain of three motors that roll, pitch and pitch, or has no foot.
    """
    _check_chain(robot, limb)
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
        raise NotALeg(f'the leg of {hip.name!r} has no length')
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


def _check_chain(robot: Robot, limb: list[Joint]) -> None:
    """Check that a limb is a chain of three turning joints, each moved by itself."""
    if has_wheel(robot, limb):
        raise NotALeg(f'a wheel at its end, {limb[-1].name}')
    is_linkage = sum(not joint.mimics for joint in limb) <= LEG_JOINTS
    for joint in limb:
        if joint.mimics and is_linkage:
            raise NotALeg(f'{joint.name} mimics {joint.mimics}: a linkage, not a joint of its own')
        if joint.kind == 'prismatic':
            raise NotALeg(f'{joint.name} slides')
    if len(limb) != LEG_JOINTS:
        raise NotALeg(f'{len(limb)} joint{"s" if len(limb) > 1 else ""} instead of {LEG_JOINTS}')
    # In a chain no two joints begin on links that move as one; with three joints in all, a
    # branch would need two joints below one.
    if len({joint.parent for joint in limb}) < 3:
        raise NotALeg(f'it branches below {limb[0].name}: a linkage')


def has_wheel(robot: Robot, limb: list[Joint]) -> bool:
    """Whether the last joint of a limb turns a wheel: without end, and round about its axis."""
    joint = limb[-1]
    if len(limb) < 2 or math.isfinite(joint.upper) or joint.kind == 'prismatic':
        return False
    if 'wheel' in f'{joint.name} {joint.child}'.lower():
        return True
    return any(
        shape.kind == 'cylinder'
        and abs(shape.pose.rotation[:, 2] @ joint.axis) > math.cos(AXIS_TOLERANCE)
        for shape in robot.links[joint.child].collisions
    )


def _check_axes(limb: list[Joint], axes: list[np.ndarray]) -> np.ndarray:
    """Return the normal of a leg's plane, (3,), to the left, if its joints roll, pitch, pitch."""
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
        raise NotALeg(f'the first about x, forward, the others both across it; found {turns}')
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
    """
    knee = poses[joint.child].position
    ends = {link: _ends(robot, link, poses[link], knee) for link in links}
    named = [link for link in links if any(word in link.lower() for word in FOOT_WORDS)]
    candidates = (
        _spheres(robot, links, poses),
        # A foot's shape says where it ends, else its frame is all there is.
        [each for link in named for each in ends[link] or [Foot(link, poses[link].position, 0.0)]],
        [each for feet in ends.values() for each in feet],
    )
    for feet in candidates:
        far = [foot for foot in feet if _distance(foot, knee) > NEAREST_SHARE * thigh]
        if far:
            foot = max(far, key=lambda foot: _distance(foot, knee))
            usual = USUAL_SHARE * (thigh + _distance(foot, knee))
            return Foot(foot.link, foot.centre, foot.radius or usual)
    raise NotALeg(
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


def _ends(robot: Robot, link: str, pose: Pose, knee: np.ndarray) -> list[Foot]:
    """Return balls that fit into the far ends of what a link collides with, but of spheres."""
    feet = []
    for shape in robot.links[link].collisions:
        place = pose @ shape.pose
        half = _half_sizes(shape)
        points = mesh_points(robot, shape) if shape.kind == 'mesh' else None
        if half is not None:
            feet.append(_end(link, place, half, knee))
        elif points is not None:
            feet.append(_tip(link, place.position + points @ place.rotation.T, knee))
    return feet


def _end(link: str, place: Pose, half: np.ndarray, knee: np.ndarray) -> Foot:
    """Return the ball in the far end of a solid, `half` (3,) [m] of its extents along its axes."""
    outward = place.rotation.T @ (place.position - knee)
    axis = int(np.argmax(np.abs(outward)))
    radius = float(min(half[axis], np.delete(half, axis).max()))
    reach = math.copysign(float(half[axis]) - radius, float(outward[axis]))
    return Foot(link, place.position + reach * place.rotation[:, axis], radius)


def _half_sizes(shape: Shape) -> np.ndarray | None:
    """Return half of a solid's extents along its own axes, shape (3,) [m]; None of others."""
    if shape.kind == 'box':
        return 0.5 * np.array(shape.size)
    if shape.kind in ('cylinder', 'capsule'):
        radius, length = shape.size
        return np.array((radius, radius, 0.5 * length + (shape.kind == 'capsule') * radius))
    return None


def _tip(link: str, points: np.ndarray, knee: np.ndarray) -> Foot:
    """
    Return the ball that fits into the end of a mesh, whose `points` (n, 3) [m] are in the base.

    The end is the slice of TIP_SHARE of the way from the knee to the farthest point. A ball of
    radius r has a half width w there with w^2 = 2 r d - d^2, d being how thick the slice is.
    """
    along = points - knee
    farthest = along[np.argmax(np.einsum('ij,ij->i', along, along))]
    length = float(np.linalg.norm(farthest))
    if length < TINY:
        return Foot(link, knee, 0.0)
    outward = farthest / length
    depth = TIP_SHARE * length
    slice_ = along[along @ outward > length - depth]
    middle = 0.5 * (slice_.min(axis=0) + slice_.max(axis=0))
    outward = middle / np.linalg.norm(middle)
    forward = np.cross((0.0, 1.0, 0.0), outward)
    across = np.abs((slice_ - middle) @ np.column_stack((forward, np.cross(outward, forward))))
    half = float(across.max(axis=0).min())  # the way it rolls: a foot may be as wide as it likes
    radius = min((half**2 + depth**2) / (2.0 * depth), MOST_SHARE * length)
    reach = float((slice_ @ outward).max()) - radius
    return Foot(link, knee + reach * outward, radius)
