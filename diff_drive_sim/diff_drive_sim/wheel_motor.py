# SPDX-License-Identifier: Apache-2.0
"""The DC motor of a wheel: torque, speed, and how fast it follows."""

from dataclasses import dataclass
import math

from robot_description.robot import Robot

from diff_drive_sim.geometry import DiffDriveGeometry

# A gear motor's stall torque over the torque that its driver lets through.
STALL_SHARE = 3.75
# The simulator integrates motor torques explicitly in steps of 1 ms: a steeper line than what
# stops a wheel in the air within one step would make it ring.
STEEPEST = 1.0 / 0.001


@dataclass(frozen=True)
class WheelMotor:
    """
    A motor at constant voltage: its torque falls linearly with speed, to none at `speed` [rad/s].

    At a duty u in -1..1 it gives `damping (u speed - w)` [N m] at wheel speed w, as far as the
    joint's torque limit lets it. Loaded with the robot it nears its speed with time constant
    `lag` [s].
    """

    speed: float
    damping: float
    lag: float


def wheel_motor(robot: Robot, geometry: DiffDriveGeometry) -> WheelMotor:
    """
    Return the motor that the description's limits, and the robot's mass, make of a wheel.

    Without an effort limit or without masses it has no torque.
    """
    joint = robot.joints[geometry.left_joint]
    radius = geometry.wheel_radius
    wheel_inertia = 0.5 * robot.links[joint.child].mass * radius**2
    inertia = 0.5 * robot.mass * radius**2
    damping = STALL_SHARE * joint.effort / geometry.speed_limit
    if wheel_inertia > 0.0:
        damping = min(damping, STEEPEST * wheel_inertia)
    lag = inertia / damping if damping > 0.0 else math.inf
    return WheelMotor(geometry.speed_limit, damping, lag)
