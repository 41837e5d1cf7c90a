# SPDX-License-Identifier: Apache-2.0
"""Wheels of a differential drive: found in the URDF, and what their speeds mean."""

from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace
import math
from typing import NamedTuple

import numpy as np
from robot_description.urdf import Joint
from robot_description.urdf import Robot

from diff_drive_sim.errors import DiffDriveError
from diff_drive_sim.wheel_parameters import WheelParameters

# Lengths in a description that differ by less than this [m] are meant to be equal.
TOLERANCE = 1e-9


@dataclass(frozen=True)
class DiffDriveGeometry:
    """
    Joint names of the two wheels, their radius and the distance between them [m].

    A direction is -1 for a joint whose axis points to the right: it turns backward to go forward.
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

    def wheel_speeds(self, linear: float, angular: float) -> tuple[float, float]:
        """Return left and right wheel speed [rad/s] of a twist [m/s], [rad/s]."""
        half = 0.5 * self.wheel_separation * angular
        left = self.left_direction * (linear - half) / self.left_radius
        right = self.right_direction * (linear + half) / self.right_radius
        return left, right

    def displacement(self, left: float, right: float) -> tuple[float, float]:
        """Return the path of the midpoint [m] and the turn [rad] of two wheel angles [rad]."""
        left_path = self.left_direction * left * self.left_radius
        right_path = self.right_direction * right * self.right_radius
        return 0.5 * (left_path + right_path), (right_path - left_path) / self.wheel_separation


def configured(
    geometry: DiffDriveGeometry, parameters: WheelParameters
) -> tuple[DiffDriveGeometry, tuple[str, ...]]:
    """Return the geometry that the parameters ask for, and in words what they contradict."""
    notes = []
    changes = {}
    for name in ('wheel_separation', 'wheel_radius'):
        described, wanted = getattr(geometry, name), getattr(parameters, name)
        if wanted == 0.0:
            continue
        changes[name] = wanted
        if not math.isclose(wanted, described, rel_tol=1e-6):
            notes.append(
                f'{name} is {wanted:g} m, but {described:g} m in the description: using '
                f'{wanted:g} (ratio {wanted / described:.3f})'
            )
    multiplier = parameters.wheel_separation_multiplier
    return replace(
        geometry,
        wheel_radius=changes.get('wheel_radius', geometry.wheel_radius),
        wheel_separation=multiplier * changes.get('wheel_separation', geometry.wheel_separation),
        left_multiplier=parameters.left_wheel_radius_multiplier,
        right_multiplier=parameters.right_wheel_radius_multiplier,
    ), tuple(notes)


class _Wheel(NamedTuple):
    """A wheel as found: joint, position in the root [m], radius [m], sign of its axis along y."""

    joint: str
    position: np.ndarray
    radius: float
    direction: int
    speed_limit: float  # [rad/s]


def find_wheels(robot: Robot, names: Sequence[str] = ()) -> DiffDriveGeometry:
    """
    Return the two wheels on one axle: cylinders that turn about y. Left is the one at larger y.

    With `names`, only these joints are looked at.

    Raises:
        DiffDriveError: there are not two of them, or their radii or positions disagree.
    """
    for name in names:
        if name not in robot.joints:
            known = ', '.join(joint.name for joint in robot.movable_joints)
            raise DiffDriveError(f'{robot.name!r} has no joint {name!r}; it has {known}')
    joints = [joint for joint in robot.movable_joints if not names or joint.name in names]
    wheels = [wheel for wheel in (_wheel(robot, joint) for joint in joints) if wheel]
    if len(wheels) != 2:
        found = ', '.join(wheel.joint for wheel in wheels) or 'none'
        raise DiffDriveError(
            f'{robot.name!r} needs 2 driven wheels (cylinders on continuous joints about y), '
            f'found {len(wheels)}: {found}'
        )
    right, left = sorted(wheels, key=lambda wheel: float(wheel.position[1]))
    if abs(left.radius - right.radius) > TOLERANCE:
        raise DiffDriveError(
            f'wheel radii differ: {left.joint} {left.radius} m, {right.joint} {right.radius} m'
        )
    x, separation, z = (left.position - right.position).tolist()
    if abs(x) > TOLERANCE or abs(z) > TOLERANCE or separation <= TOLERANCE:
        raise DiffDriveError(f'{left.joint} and {right.joint} are not on one axle along y')
    axle_x, axle_y, _ = (0.5 * (left.position + right.position)).tolist()
    return DiffDriveGeometry(
        left.joint,
        right.joint,
        left.radius,
        separation,
        left.direction,
        right.direction,
        axle_x,
        axle_y,
        min(left.speed_limit, right.speed_limit),
    )


def _wheel(robot: Robot, joint: Joint) -> _Wheel | None:
    pose = robot.pose_of(joint.child)
    axis = pose.rotation @ joint.axis
    cylinders = [s for s in robot.links[joint.child].collisions if s.kind == 'cylinder']
    if joint.kind != 'continuous' or abs(axis[1]) < 1.0 - 1e-6 or not cylinders:
        return None
    direction = 1 if axis[1] > 0.0 else -1
    limit = joint.velocity if joint.velocity > 0.0 else math.inf
    return _Wheel(joint.name, pose.position, cylinders[0].size[0], direction, limit)
