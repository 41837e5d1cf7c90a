# SPDX-License-Identifier: Apache-2.0
"""Wheels of a differential drive: found in the URDF, and what their speeds mean."""

from dataclasses import dataclass

from robot_description.urdf import Joint
from robot_description.urdf import Robot

from diff_drive_sim.errors import DiffDriveError


@dataclass(frozen=True)
class DiffDriveGeometry:
    """Joint names of the two wheels, their radius and the distance between them [m]."""

    left_joint: str
    right_joint: str
    wheel_radius: float
    wheel_separation: float

    def wheel_speeds(self, linear: float, angular: float) -> tuple[float, float]:
        """Return left and right wheel speed [rad/s] of a twist [m/s], [rad/s]."""
        half = 0.5 * self.wheel_separation * angular
        return (linear - half) / self.wheel_radius, (linear + half) / self.wheel_radius

    def displacement(self, left: float, right: float) -> tuple[float, float]:
        """Return the path of the midpoint [m] and the turn [rad] of two wheel angles [rad]."""
        forward = 0.5 * (left + right) * self.wheel_radius
        return forward, (right - left) * self.wheel_radius / self.wheel_separation


def find_wheels(robot: Robot) -> DiffDriveGeometry:
    """
    Return the two coaxial wheels of a robot: cylinders that turn about y, one on each side.

    Raises:
        DiffDriveError: there are not two of them, or their radii or positions disagree.

    """
    wheels = {}
    for joint in robot.movable_joints:
        radius = _wheel_radius(robot, joint)
        if radius is not None:
            wheels[joint.name] = (robot.pose_of(joint.child).position, radius)
    if len(wheels) != 2:
        found = ', '.join(wheels) or 'none'
        raise DiffDriveError(
            f'{robot.name!r} needs 2 driven wheels (cylinders on continuous joints about y), '
            f'found {len(wheels)}: {found}'
        )
    (right, (p_right, r_right)), (left, (p_left, r_left)) = sorted(
        wheels.items(), key=lambda item: float(item[1][0][1])
    )
    if abs(r_left - r_right) > 1e-9:
        raise DiffDriveError(f'wheel radii differ: {left} {r_left} m, {right} {r_right} m')
    if abs(p_left[0] - p_right[0]) > 1e-9 or abs(p_left[2] - p_right[2]) > 1e-9:
        raise DiffDriveError(f'{left} and {right} are not on one axle')
    return DiffDriveGeometry(left, right, r_left, float(p_left[1] - p_right[1]))


def _wheel_radius(robot: Robot, joint: Joint) -> float | None:
    axis = robot.pose_of(joint.child).rotation @ joint.axis
    if joint.kind != 'continuous' or abs(axis[1]) < 1.0 - 1e-6:
        return None
    cylinders = [s for s in robot.links[joint.child].collisions if s.kind == 'cylinder']
    return cylinders[0].size[0] if cylinders else None
