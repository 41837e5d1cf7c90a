# SPDX-License-Identifier: Apache-2.0
"""Wheels of a differential drive: found in the URDF, and what their speeds mean."""

from collections.abc import Sequence
from dataclasses import dataclass
import math

from robot_description.morphology.wheels import drive_wheels
from robot_description.morphology.wheels import TOLERANCE
from robot_description.robot import Robot
from wasd_core.errors import UserError

Pair = tuple[float, float]


class DiffDriveError(UserError):
    """The diff-drive controller cannot do what was asked; the text is one line."""


@dataclass(frozen=True)
class DiffDriveGeometry:
    """
    Joint names of the two wheels, their radius and the distance between them [m].

    Wheel angles and speeds are forward ones here and everywhere inside this package. A direction
    is -1 for a joint whose axis points to the right, which turns backward to go forward: `flip`.
    `axle_x`, `axle_y` are where the middle of the axle is in the robot's root frame [m];
    `speed_limit` is what the slower wheel can do [rad/s]; the multipliers are a calibration's.
    """

    left_joint: str
    right_joint: str
    wheel_radius: float
    wheel_separation: float
    left_direction: int = 1
    right_direction: int = 1
    axle_x: float = 0.0
    axle_y: float = 0.0
    speed_limit: float = math.inf
    left_multiplier: float = 1.0
    right_multiplier: float = 1.0

    @property
    def left_radius(self) -> float:
        """Radius of the left wheel [m]."""
        return self.left_multiplier * self.wheel_radius

    @property
    def right_radius(self) -> float:
        """Radius of the right wheel [m]."""
        return self.right_multiplier * self.wheel_radius

    def flip(self, wheels: Pair) -> Pair:
        """Return left and right joint angles or speeds of the wheels' forward ones, or back."""
        return self.left_direction * wheels[0], self.right_direction * wheels[1]

    def wheel_speeds(self, linear: float, angular: float) -> tuple[float, float]:
        """Return left and right wheel speed [rad/s] of a twist [m/s], [rad/s]."""
        half = 0.5 * self.wheel_separation * angular
        return (linear - half) / self.left_radius, (linear + half) / self.right_radius

    def displacement(self, left: float, right: float) -> tuple[float, float]:
        """Return the path of the midpoint [m] and the turn [rad] of two wheel angles [rad]."""
        left_path, right_path = left * self.left_radius, right * self.right_radius
        return 0.5 * (left_path + right_path), (right_path - left_path) / self.wheel_separation


def find_wheels(robot: Robot, names: Sequence[str] = ()) -> DiffDriveGeometry:
    """
    Return the two driven wheels of a robot; with `names`, only these joints are looked at.

    Raises:
        DiffDriveError: there are not two of them, or their radii or positions disagree.
    """
    for name in names:
        if name not in robot.joints:
            known = ', '.join(joint.name for joint in robot.movable_joints)
            raise DiffDriveError(f'{robot.name!r} has no joint {name!r}; it has {known}')
    wheels = drive_wheels(robot, names)
    if len(wheels) != 2:
        found = ', '.join(wheel.joint.name for wheel in wheels) or 'none'
        raise DiffDriveError(
            f'{robot.name!r} needs 2 driven wheels (cylinders on continuous joints about y), '
            f'found {len(wheels)}: {found}; left_wheel_names and right_wheel_names choose'
        )
    left, right = wheels
    if abs(left.radius - right.radius) > TOLERANCE:
        raise DiffDriveError(
            f'wheel radii differ: {left.joint.name} {left.radius} m, '
            f'{right.joint.name} {right.radius} m'
        )
    x, separation, z = (left.position - right.position).tolist()
    if abs(x) > TOLERANCE or abs(z) > TOLERANCE or separation <= TOLERANCE:
        raise DiffDriveError(
            f'{left.joint.name} and {right.joint.name} are not on one axle along y'
        )
    axle_x, axle_y, _ = (0.5 * (left.position + right.position)).tolist()
    speeds = [wheel.joint.velocity for wheel in wheels if wheel.joint.velocity > 0.0]
    return DiffDriveGeometry(
        left.joint.name,
        right.joint.name,
        left.radius,
        separation,
        left.direction,
        right.direction,
        axle_x,
        axle_y,
        min(speeds, default=math.inf),
    )
