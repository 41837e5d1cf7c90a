# SPDX-License-Identifier: Apache-2.0
"""
How strong a driven wheel's motor is: scaled to what it moves, as the legs' gains are.

A motor at constant voltage has a torque that falls linearly with speed (any textbook: Franklin,
Powell, Emami-Naeini, Feedback Control of Dynamic Systems, section 2.3). How steeply, `damping`
[N m s/rad], decides how soon the wheel is at its speed: with what a wheel moves, J, it nears it
with the time constant J / damping.

What one of two wheels moves is seen at its axis as an inertia. Straight ahead it is half the mass
at the rim, M r^2 / 2. In a turn on the spot the rims, half a track b from the middle, go b / 2 per
radian, and forces F on both make the moment F b, so that it is Iz (2 r / b) (r / b) =
2 Iz r^2 / b^2. The larger of the two is what the line is made for: descriptions name any efforts
and speeds, from 0 to 1e7.

The physics takes motors explicitly, in steps of 1 ms: a line that would stop a wheel in the air in
less than a step makes it ring. A wheel too light for its line gets a rotor, as gear motors have
one: it adds to what turns about the wheel's axis.
"""

import math
from typing import NamedTuple

from wasd_core.robot_io import TIME_STEP

from robot_description.morphology.wheels import Drive
from robot_description.robot import Joint
from robot_description.robot import Robot

# A gear motor's stall torque over the torque that its driver lets through.
STALL_SHARE = 3.75
# A loaded wheel nears its speed no sooner and no later than with these time constants [s]; mbot,
# for which the loop was tuned, has 0.011.
QUICKEST, SLOWEST = 0.010, 0.025
# A joint that damps is driven by a line so much steeper: else it would decide the speed.
OVER_DRAG = 4.0


class MotorSize(NamedTuple):
    """
    The motor of each of two driven wheels.

    `damping` [N m s/rad] is the slope of its line, `rotor` [kg m^2] what it adds to its wheel;
    `straight` and `turning` [kg m^2] are what the wheel moves, seen at its axis.
    """

    damping: float
    rotor: float
    straight: float
    turning: float


class Strength(NamedTuple):
    """What motors allow along one axis [m/s^2] or [rad/s^2]; infinite where nobody knows."""

    speed_up: float = math.inf
    slow_down: float = math.inf

    def scaled(self, factor: float) -> 'Strength':
        """Return so many times this."""
        return Strength(factor * self.speed_up, factor * self.slow_down)


def size_motor(robot: Robot, drive: Drive) -> MotorSize:
    """Return the motor of each of two wheels; without a torque limit or masses it has none."""
    left, right = drive.wheels
    joint, radius = drive.weakest.joint, drive.weakest.radius
    middle = 0.5 * (left.position + right.position)
    straight = 0.5 * robot.mass * radius**2
    turning = 2.0 * yaw_inertia(robot, float(middle[0]), float(middle[1]))
    turning *= (radius / drive.track) ** 2
    load = max(straight, turning)
    described = STALL_SHARE * joint.effort / joint.velocity if joint.velocity > 0.0 else 0.0
    steepest = load / QUICKEST + OVER_DRAG * joint.damping
    damping = min(max(described, load / SLOWEST), steepest) if described > 0.0 else 0.0
    rotor = max(0.0, TIME_STEP * damping - axle_inertia(robot, joint))
    return MotorSize(damping, rotor, straight, turning)


def strength(robot: Robot, drive: Drive) -> tuple[Strength, Strength]:
    """
    Return what the motors allow ahead [m/s^2] and of a turn [rad/s^2]: the weaker one decides.

    Dry friction takes of the torque that speeds a wheel up, and helps to brake it.
    """
    size = size_motor(robot, drive)
    if size.damping == 0.0:
        return Strength(), Strength()
    weakest = drive.weakest
    torque = Strength(
        max(0.0, weakest.joint.effort - weakest.joint.friction),
        min(wheel.joint.effort + wheel.joint.friction for wheel in drive.wheels),
    )
    own = axle_inertia(robot, weakest.joint) + size.rotor
    ahead = weakest.radius / (size.straight + own)
    turning = 2.0 * weakest.radius / drive.track / (size.turning + own)
    return torque.scaled(ahead), torque.scaled(turning)


def rotors(robot: Robot, drive: Drive) -> dict[str, float]:
    """Return what rotors add to the driven wheels [kg m^2] by joint, where these need one."""
    rotor = size_motor(robot, drive).rotor if drive.wheels else 0.0
    return {wheel.joint.name: rotor for wheel in drive.wheels} if rotor > 0.0 else {}


def yaw_inertia(robot: Robot, x: float, y: float) -> float:
    """Return the robot's moment of inertia about a vertical line [kg m^2], in its rest pose."""
    total = 0.0
    for link in robot.links.values():
        pose = robot.rest_poses[link.name] @ link.inertial
        up = pose.rotation[2]
        arm = (pose.position[0] - x) ** 2 + (pose.position[1] - y) ** 2
        total += float(up @ link.inertia @ up) + link.mass * float(arm)
    return total


def axle_inertia(robot: Robot, joint: Joint) -> float:
    """Return a wheel's own moment of inertia about its axis [kg m^2]."""
    link = robot.links[joint.child]
    axis = link.inertial.rotation.T @ joint.axis
    return float(axis @ link.inertia @ axis)
