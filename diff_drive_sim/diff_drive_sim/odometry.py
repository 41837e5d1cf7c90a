# SPDX-License-Identifier: Apache-2.0
"""
Two driven wheels: found in the URDF, their kinematics and odometry.

How sure that is grows with how far it went.
"""

from collections import deque
from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np
from robot_description.morphology.kinds import name_kind
from robot_description.morphology.wheels import (
    ANY_WHEELS,
    Drive,
    find_drive,
    looks_along_y,
    WheelChoice,
)
from robot_description.robot import Robot
from wasd_core.errors import UserError

# What to do where wheels are not found.
CURE = 'left_wheel_names, right_wheel_names and wheel_radius in a --controller file say which'
TURNED = 'the robot looks along y: turn its root by 90 degrees (x forward, y left: REP 103)'
Pair = tuple[float, float]


class DiffDriveError(UserError):
    """The diff-drive controller cannot carry out a request; the text is one line."""


@dataclass(frozen=True)
class DiffDriveGeometry:
    """
    Joint names of the two wheels, their radius and the distance between them [m].

    Wheel angles and speeds are forward ones here and everywhere inside this package. A direction
    is -1 for a joint whose axis points to the right, which turns backward to go forward: `flip`.
    `axle_x`, `axle_y` are where the middle of the axle is in the frame of the robot [m];
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
    if drive.wheels:
        return drive
    what, cure = ('', '') if choice.names else name_kind(robot, drive)
    if what:
        it_is = 'is' if drive.what else 'has no two driven wheels: it is'
        raise DiffDriveError(f'{robot.name!r} {it_is} {what}; {cure}')
    cure = '' if choice.names else f'; {CURE}'
    if looks_along_y(robot):
        cure = f'; {TURNED}'
    raise DiffDriveError(f'{robot.name!r} {drive.why_not()}{cure}')


def geometry_of(robot: Robot, drive: Drive) -> DiffDriveGeometry:
    """Return the geometry of a robot's two driven wheels."""
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
    return geometry_of(robot, find_pair(robot, choice))


class PlanarCovariance(NamedTuple):
    """The symmetric covariance of x, y [m] and yaw [rad]."""

    xx: float = 0.0
    xy: float = 0.0
    yy: float = 0.0
    x_yaw: float = 0.0
    y_yaw: float = 0.0
    yaw_yaw: float = 0.0


class Growth(NamedTuple):
    """
    Variances that a path and a turn add.

    A path of s [m] and a turn of t [rad] are uncertain by `distance` |s| [m^2] along the path,
    and by `turn` |t| + `drift` |s| [rad^2] in heading.
    """

    distance: float = 0.0
    turn: float = 0.0
    drift: float = 0.0


def grow_covariance(
    before: PlanarCovariance,
    growth: Growth,
    forward: float,
    turn: float,
    heading: float,
    shift: tuple[float, float],
) -> PlanarCovariance:
    """
    Return the covariance after a move: P' = F P F^T + Q.

    The place has shifted by `shift` [m]. F carries the error of the heading into it:
    dx' = dx - shift_y dyaw and dy' = dy + shift_x dyaw. Q is the move's own error: along its
    mean heading, and in yaw.
    """
    if forward == 0.0 and turn == 0.0:
        return before
    a, b = -shift[1], shift[0]
    along = growth.distance * abs(forward)
    around = growth.turn * abs(turn) + growth.drift * abs(forward)
    cos, sin = math.cos(heading), math.sin(heading)
    xx, xy, yy, x_yaw, y_yaw, yaw_yaw = before
    return PlanarCovariance(
        xx + 2.0 * a * x_yaw + a * a * yaw_yaw + along * cos * cos,
        xy + b * x_yaw + a * y_yaw + a * b * yaw_yaw + along * cos * sin,
        yy + 2.0 * b * y_yaw + b * b * yaw_yaw + along * sin * sin,
        x_yaw + a * yaw_yaw,
        y_yaw + b * yaw_yaw,
        yaw_yaw + around,
    )


# Wheels are believed to turn at most so many times as fast as they can be commanded to: one that
# is pushed or slips is faster than that, one whose encoder has restarted much faster.
BELIEVABLE = 4.0
# A change of angle that is always believed [rad], however little time has passed.
SMALLEST_JUMP = 0.05


class OdometryState(NamedTuple):
    """Pose of the robot's base in the odom frame [m], [rad], its twist in the base frame."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    linear: float = 0.0  # [m/s], forward
    angular: float = 0.0  # [rad/s]
    lateral: float = 0.0  # [m/s], to the left: of a base that is not on the axle

    @property
    def position(self) -> np.ndarray:
        """Where the base is in odom [m], (3,)."""
        return np.array((self.x, self.y, 0.0))

    @property
    def orientation(self) -> np.ndarray:
        """Quaternion (w, x, y, z) from base to odom, (4,)."""
        return np.array((math.cos(0.5 * self.yaw), 0.0, 0.0, math.sin(0.5 * self.yaw)))

    @property
    def linear_velocity(self) -> np.ndarray:
        """Velocity in base axes [m/s], (3,)."""
        return np.array((self.linear, self.lateral, 0.0))

    @property
    def angular_velocity(self) -> np.ndarray:
        """Turn in base axes [rad/s], (3,)."""
        return np.array((0.0, 0.0, self.angular))


class _Move(NamedTuple):
    """What a step has added: path of the axle's middle [m], turn [rad], time [s]."""

    forward: float
    turn: float
    elapsed: float


class WheelOdometry:
    """
    Integrates wheel angles along exact arcs.

    Keeps the pose, its covariance and the last wheel angles; the first `step` only takes the
    angles in, so that encoders that do not start at 0 move nothing. Nor does a change that no
    wheel can make at `speed_limit` [rad/s], the largest speed it is commanded to: encoders that
    have restarted, e.g. because the simulator in another process was reset. `restarts` counts
    them. Angles are in steps of `resolution` [rad]; 0: exact. The velocity is the mean over the
    last `window` steps.
    """

    def __init__(self, geometry: DiffDriveGeometry, window: int = 1) -> None:
        self._geometry = geometry
        self.speed_limit = math.inf
        self.resolution = 0.0
        self.growth = Growth()
        self.restarts = 0
        self._moves: deque[_Move] = deque(maxlen=window)
        self.reset()

    def reset(self) -> None:
        """Put the robot at the origin of the odom frame; what it does not move, it forgets."""
        self.state = OdometryState()
        self.covariance = PlanarCovariance()
        self._angles: tuple[float, float] | None = None
        self._elapsed = 0.0  # [s] since those angles
        self._moves.clear()

    def set_pose(self, x: float, y: float, yaw: float, covariance: PlanarCovariance) -> None:
        """Be at a pose from now on, known so well; the velocity stays as it is."""
        self.state = self.state._replace(x=x, y=y, yaw=yaw)
        self.covariance = covariance

    def step(self, left: float, right: float, dt: float) -> OdometryState:
        """Take in wheel angles [rad] `dt` [s] after the last; not finite, they change nothing."""
        self._elapsed += dt
        if not (math.isfinite(left) and math.isfinite(right)):
            return self.state
        if self._angles is not None:
            changes = left - self._angles[0], right - self._angles[1]
            if self._can_be(changes):
                self._move(_Move(*self._geometry.displacement(*changes), self._elapsed))
            else:
                self.restarts += 1
                self._moves.clear()
                self.state = self.state._replace(linear=0.0, angular=0.0, lateral=0.0)
        self._angles = (left, right)
        self._elapsed = 0.0
        return self.state

    def advance(self, linear: float, angular: float, dt: float) -> OdometryState:
        """Move as a velocity [m/s], [rad/s] of the axle's middle says, whatever the wheels do."""
        self._move(_Move(linear * dt, angular * dt, dt))
        return self.state

    def _can_be(self, changes: tuple[float, float]) -> bool:
        if math.isinf(self.speed_limit):
            return True
        largest = max(SMALLEST_JUMP, BELIEVABLE * self.speed_limit * self._elapsed)
        return max(map(abs, changes)) <= largest + self.resolution

    def _move(self, move: _Move) -> None:
        """
        Move the axle's middle along an arc, and the base with it.

        The circle has radius forward / turn: its chord is forward sin(turn/2) / (turn/2) along
        the mean heading, which is exact for constant speeds.
        """
        before = self.state
        offset_x, offset_y = self._geometry.axle_x, self._geometry.axle_y
        heading = before.yaw + 0.5 * move.turn
        yaw = before.yaw + move.turn
        chord = move.forward * _sinc(0.5 * move.turn)
        # p_base = p_axle - R(yaw) offset, hence what R changes moves the base, too.
        cos = math.cos(before.yaw) - math.cos(yaw)
        sin = math.sin(before.yaw) - math.sin(yaw)
        x = before.x + chord * math.cos(heading) + cos * offset_x - sin * offset_y
        y = before.y + chord * math.sin(heading) + sin * offset_x + cos * offset_y
        self.covariance = grow_covariance(
            self.covariance,
            self.growth,
            move.forward,
            move.turn,
            heading,
            (x - before.x, y - before.y),
        )
        linear, angular = self._mean_velocity(move)
        self.state = OdometryState(
            x, y, yaw, linear + angular * offset_y, angular, -angular * offset_x
        )

    def _mean_velocity(self, move: _Move) -> tuple[float, float]:
        """Return the velocity of the axle's middle over the window."""
        if move.elapsed > 0.0:
            self._moves.append(move)
        elapsed = sum(each.elapsed for each in self._moves)
        if elapsed <= 0.0:
            return 0.0, 0.0
        forward = sum(each.forward for each in self._moves)
        return forward / elapsed, sum(each.turn for each in self._moves) / elapsed


class KinematicBase:
    """
    Two wheels without slip, motors or mass: what mode fake drives.

    Keeps the wheels' angles and the true pose; `step` turns the wheels at speeds [rad/s] for a
    time [s].
    """

    def __init__(self, geometry: DiffDriveGeometry) -> None:
        self._rolling = WheelOdometry(geometry)
        self.reset()

    def reset(self) -> None:
        """Be at the origin, the wheels at angle 0."""
        self._rolling.reset()
        self.angles = (0.0, 0.0)
        self.speeds = (0.0, 0.0)
        self._rolling.step(*self.angles, 0.0)

    @property
    def pose(self) -> OdometryState:
        """Where it is, and its velocity."""
        return self._rolling.state

    def step(self, left: float, right: float, dt: float) -> None:
        """Turn the wheels at speeds [rad/s] for `dt` [s]."""
        self.speeds = (left, right)
        self.angles = (self.angles[0] + left * dt, self.angles[1] + right * dt)
        self._rolling.step(*self.angles, dt)


def _sinc(angle: float) -> float:
    """Return sin(angle) / angle; its series where the quotient would lose digits."""
    if abs(angle) < 1e-4:
        return 1.0 - angle * angle / 6.0
    return math.sin(angle) / angle
