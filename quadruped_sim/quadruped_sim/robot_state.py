# SPDX-License-Identifier: Apache-2.0
"""Everything the controller's parts need to know about one tick, computed once."""

from dataclasses import dataclass

import numpy as np

from quadruped_sim.leg_kinematics import LegMotion
from quadruped_sim.robot_model import Dynamics
from quadruped_sim.whole_body import ContactPoints


@dataclass(frozen=True)
class RobotState:
    """
    Estimated state of one tick.

    `position` and `velocity` of the base are in the world, `R` turns base axes into it,
    `orientation` (w, x, y, z) and `rpy` say the same; `omega` is in base axes. `feet` (4, 3) are
    the foot centres in the world and `com` (3,) the centre of mass in base axes. `normal_forces`
    (4,) [N] are estimated from the joint torques, `is_contact` (4,) follows from them.
    """

    joint_position: np.ndarray
    joint_velocity: np.ndarray
    orientation: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    R: np.ndarray
    rpy: np.ndarray
    omega: np.ndarray
    motion: LegMotion
    contact: ContactPoints
    dynamics: Dynamics
    feet: np.ndarray
    com: np.ndarray
    normal_forces: np.ndarray
    is_contact: np.ndarray
