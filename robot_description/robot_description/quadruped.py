# SPDX-License-Identifier: Apache-2.0
"""Recognises a quadruped by its tree and geometry, whatever its links and joints are called."""

from dataclasses import dataclass

import numpy as np
from wasd_core.rotations import Pose

from robot_description.leg import Leg
from robot_description.leg import measure_leg
from robot_description.leg import NotAQuadruped
from robot_description.leg import WANTED
from robot_description.urdf import Joint
from robot_description.urdf import Robot

# More limbs than this are counted, not listed.
LISTED = 8
# Names that are an IMU's, the likeliest first; then any that has `imu` in it.
IMU_LINKS = ('imu', 'imu_link')


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
    trunk = groups[robot.base]
    limbs = _limbs(robot, groups)
    if len(limbs) != 4 or any(not _is_leg(limb) for limb in limbs):
        raise NotAQuadruped(f'{WANTED}; found {_describe(limbs, robot.base)}')
    poses = poses_in_base(robot)
    legs = [measure_leg(robot, groups, poses, limb) for limb in limbs]
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


def find_imu(robot: Robot) -> str | None:
    """Return the link on the trunk that is an IMU by its name, or None."""
    trunk = links_on_trunk(robot)
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
