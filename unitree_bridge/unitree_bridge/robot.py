# SPDX-License-Identifier: Apache-2.0
"""The simulated robot as Unitree's interface sees it, and in which order it tells of its legs."""

from typing import NamedTuple, Protocol

import numpy as np
from quadruped_sim.keys import StateName
from wasd_core.robot_io import BaseOdometry, ImuReading, JointCommand, JointStates

from unitree_bridge.remote import Remote

# Who drives when an SDK program does.
SOURCE = 'unitree'
# The legs of the controller FL FR RL RR, in Unitree's order FR FL RR RL; it is its own inverse.
LEGS = np.array((1, 0, 3, 2))
MOTORS = (3 * LEGS[:, None] + np.arange(3)).ravel()

Velocity = tuple[float, float, float]


class Senses(NamedTuple):
    """
    What the robot measures in one instant, legs and motors in Unitree's order.

    `joints` are (12,), angles as Unitree's; `foot_force` (4,) [N] is measured, `foot_force_est`
    follows from the joints' torques.
    """

    joints: JointStates
    imu: ImuReading
    foot_force: np.ndarray
    foot_force_est: np.ndarray


class Robot(Protocol):
    """What the interface asks of a robot. Keys and velocities may be refused, as by E-STOP."""

    @property
    def time(self) -> float:
        """Simulated time [s]."""

    @property
    def state(self) -> StateName:
        """The state of our controller."""

    @property
    def is_up(self) -> bool:
        """Whether its legs hold it about as high as in the stand."""

    @property
    def gait(self) -> str:
        """The gait that is chosen."""

    @property
    def height(self) -> float:
        """Of the base above the ground under its lowest foot [m]."""

    @property
    def odometry(self) -> BaseOdometry | None:
        """Where it believes to be; None before the first reading."""

    @property
    def full_speed(self) -> Velocity:
        """How fast full sticks drive it [m/s], [m/s], [rad/s]."""

    @property
    def remote(self) -> Remote:
        """How the sticks and buttons of its remote control are."""

    def senses(self) -> Senses:
        """Return what it measures now."""

    def feet(self) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] of the feet in base axes, (12,) each."""

    def press(self, key: str) -> bool:
        """Press a key of our controller; return whether that counts."""

    def drive(self, velocity: Velocity) -> bool:
        """Command a velocity [m/s], [m/s], [rad/s]; return whether that counts."""

    def release(self) -> None:
        """Hold nothing any more: what we move stops."""

    def take_motors(self) -> bool:
        """Return whether commands to the motors themselves count now."""

    def let_go(self) -> None:
        """Stop our controller: from now on it damps."""

    def picture(self) -> bytes:
        """
        Return what the robot sees ahead, as a JPEG.

        Raises:
            UserError: nothing can be rendered here.
        """

    def guard(self, is_on: bool) -> bool:
        """Let what the lidar sees stop it, or not; return False where it has no such guard."""


def to_motors(command: JointCommand) -> JointCommand:
    """Return a command in Unitree's order in the controller's, or the other way round."""
    return JointCommand(*(part[MOTORS] for part in command))
