# SPDX-License-Identifier: Apache-2.0
"""Wheels of a differential drive: found in the URDF, and what their speeds mean."""

from dataclasses import dataclass
import math

from robot_description.morphology.wheels import ANY_WHEELS
from robot_description.morphology.wheels import Drive
from robot_description.morphology.wheels import find_drive
from robot_description.morphology.wheels import WheelChoice
from robot_description.robot import Robot
from wasd_core.errors import UserError

# What to do where wheels are not found.
CURE = 'left_wheel_names, right_wheel_names and wheel_radius in a --controller file say which'
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
    `speed_limit` is what the slower wheel can do [rad/s]; the multipliers are a calibration's, and
    those of wheels that differ.
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


def find_pair(robot: Robot, choice: WheelChoice = ANY_WHEELS) -> Drive:
    """
    Return the two driven wheels of a robot; a choice says which joints they are.

    Raises:
        DiffDriveError: there are not two of them; says what each that might be one is.
    """
    for name in choice.names:
        if name not in robot.joints:
            known = ', '.join(joint.name for joint in robot.movable_joints)
            raise DiffDriveError(f'{robot.name!r} has no joint {name!r}; it has {known}')
    drive = find_drive(robot, choice)
    if not drive.wheels:
        cure = '' if choice.names else f'; {CURE}'
        raise DiffDriveError(f'{robot.name!r} {drive.why_not()}{cure}')
    return drive


def geometry_of(drive: Drive) -> DiffDriveGeometry:
    """Return the geometry of two driven wheels."""
    left, right = drive.wheels
    axle_x, axle_y, _ = (0.5 * (left.position + right.position)).tolist()
    return DiffDriveGeometry(
        left.joint.name,
        right.joint.name,
        left.radius,
        drive.track,
        left.direction,
        right.direction,
        axle_x,
        axle_y,
        drive.speed_limit,
        right_multiplier=right.radius / left.radius,
    )


def find_wheels(robot: Robot, choice: WheelChoice = ANY_WHEELS) -> DiffDriveGeometry:
    """
    Return the geometry of a robot's two driven wheels.

    Raises:
        DiffDriveError: see `find_pair`.
    """
    return geometry_of(find_pair(robot, choice))
