# SPDX-License-Identifier: Apache-2.0
"""Motors only damp: the robot sinks to the ground."""

import numpy as np
from robot_description.morphology.quadruped import Scale

from quadruped_sim.records import LegCommand
from quadruped_sim.robot_state import RobotState
from quadruped_sim.states.base import State

# unitree_guide damps with 8 in simulation and 3 on the robot [N m s/rad].
_DAMPING = 8.0


def damping_command(scale: Scale, joint_position: np.ndarray) -> LegCommand:
    """Damp every joint and nothing else."""
    damping = _DAMPING * scale.of('N m s/rad')
    return LegCommand(position=joint_position.copy(), kd=np.full(12, damping))


class Passive(State):
    """Damps; the start state, and where every guard leads."""

    def enter(self, robot: RobotState) -> None:
        """End whatever gait there was."""
        self._parts.locomotion.gait.reset()

    def step(self, robot: RobotState, dt: float) -> LegCommand:
        """Damping, whatever the pose."""
        return damping_command(self._parts.model.scale, robot.joint_position)
