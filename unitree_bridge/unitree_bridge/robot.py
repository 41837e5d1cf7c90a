# SPDX-License-Identifier: Apache-2.0
"""What Unitree's interface calls a robot's legs and motors, and what it measures."""

from typing import NamedTuple

import numpy as np
from wasd_core.robot_io import ImuReading, JointCommand, JointStates

# The name of the source when a program of the SDK drives.
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


def to_motors(command: JointCommand) -> JointCommand:
    """Return a command in Unitree's order in the controller's, or the other way round."""
    return JointCommand(*(part[MOTORS] for part in command))
