# SPDX-License-Identifier: Apache-2.0
"""Stands up on a straight line in joint space and holds the pose."""

import numpy as np

from quadruped_sim.records import LegCommand
from quadruped_sim.robot_model import RobotModel
from quadruped_sim.robot_state import RobotState
from quadruped_sim.states.base import State

STAND_TIME = 2.0
# unitree_guide's simulation gains [N m/rad], [N m s/rad]; its robot gains sag by 8 mm more.
_KP = np.tile((180.0, 180.0, 300.0), 4)
_KD = np.tile((8.0, 8.0, 15.0), 4)
# A trot that has not ended by now is ended anyway [s].
_HALT_TIME_MAX = 3.0


def stiff_command(model: RobotModel, position: np.ndarray) -> LegCommand:
    """Hold leg angles `position` (12,) [rad] against the robot's weight."""
    kp, kd = model.scale.of('N m/rad'), model.scale.of('N m s/rad')
    return LegCommand(position=position, kp=_KP * kp, kd=_KD * kd)


class FixedStand(State):
    """
    2.0 s from the measured pose to the stand; entering again starts again.

    A robot that trots is brought to rest first: stiff legs at 1 m/s are a somersault, which is
    what unitree_guide's key 2 does.
    """

    def enter(self, robot: RobotState) -> None:
        """Remember the pose to start from, or halt first."""
        self._start = robot.joint_position.copy()
        self._time = 0.0
        self._halting = _HALT_TIME_MAX if self._parts.locomotion.gait.is_stepping else 0.0
        self.trust = np.ones(4)

    def step(self, robot: RobotState, dt: float) -> LegCommand:
        """Next point of the line, or of the way to a halt."""
        if self._halting > 0.0:
            return self._halt(robot, dt)
        self._time += dt
        share = min(self._time / STAND_TIME, 1.0)
        position = (1.0 - share) * self._start + share * self._parts.model.standing_pose
        return stiff_command(self._parts.model, position)

    def _halt(self, robot: RobotState, dt: float) -> LegCommand:
        """Trot on toward rest; the line starts from where the last step ends."""
        locomotion, command_filter = self._parts.locomotion, self._parts.command_filter
        command_filter.request(0.0, 0.0, 0.0)
        command = locomotion.step(robot, command_filter.step(dt), dt, is_halting=True)
        self.trust = locomotion.trust(robot)
        self._halting -= dt
        if not locomotion.gait.is_stepping or self._halting <= 0.0:
            locomotion.gait.reset()
            self._halting = 0.0
            self._start = robot.joint_position.copy()
            self.trust = np.ones(4)
        return command
