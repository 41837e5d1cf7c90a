# SPDX-License-Identifier: Apache-2.0
"""Lifts one foot after the other by 10 cm on a Go2, the base moving over the three that stand."""

import math

import numpy as np

from quadruped_sim.legs import FRONT
from quadruped_sim.legs import LEFT
from quadruped_sim.records import LegCommand
from quadruped_sim.robot_state import RobotState
from quadruped_sim.rotations import yaw_matrix
from quadruped_sim.stander import stand_command
from quadruped_sim.states.base import State

_ORDER = (1, 2, 0, 3)  # FR RL FL RR
_SHIFT_TIME = 1.0
_LIFT_TIME = 1.0
# Half of how high a foot goes, and shift of the base away from it [m]; both on the Go2.
_HALF_HEIGHT = 0.05
_SHIFT = (0.045, 0.035)


class StepTest(State):
    """Height h(t) = 0.05 (1 - cos), as unitree_guide's, one leg at a time."""

    def enter(self, robot: RobotState) -> None:
        """Remember where base and feet are."""
        self._centre = robot.position.copy()
        self._yaw = float(robot.rpy[2])
        self._feet = robot.feet.copy()
        self._time = 0.0
        self._from = np.zeros(2)
        self.trust = np.ones(4)

    def step(self, robot: RobotState, dt: float) -> LegCommand:
        """Shift the base for `_SHIFT_TIME`, then lift and lower one foot for `_LIFT_TIME`."""
        self._time += dt
        cycle = _SHIFT_TIME + _LIFT_TIME
        turn, time = divmod(self._time, cycle)
        leg = _ORDER[int(turn) % 4]
        size = self._parts.model.scale.of('m')
        before = size * _away_from(_ORDER[(int(turn) - 1) % 4]) if turn >= 1.0 else np.zeros(2)
        share = min(time / _SHIFT_TIME, 1.0)
        share = share * share * (3.0 - 2.0 * share)
        shift = before + share * (size * _away_from(leg) - before)

        is_stance = np.ones(4, dtype=bool)
        feet = self._feet.copy()
        if time > _SHIFT_TIME:
            is_stance[leg] = False
            angle = 2.0 * math.pi * (time - _SHIFT_TIME) / _LIFT_TIME
            feet[leg, 2] += size * _HALF_HEIGHT * (1.0 - math.cos(angle))
        else:
            self._feet[robot.is_contact] = robot.feet[robot.is_contact]
        self.trust = is_stance.astype(float)
        position = self._centre + yaw_matrix(self._yaw) @ np.array((*shift, 0.0))
        parts = self._parts
        return stand_command(
            parts.locomotion.whole_body,
            parts.model,
            parts.params,
            robot,
            position,
            np.array((0.0, 0.0, self._yaw)),
            is_stance,
            feet,
        )


def _away_from(leg: int) -> np.ndarray:
    return np.array((-FRONT[leg] * _SHIFT[0], -LEFT[leg] * _SHIFT[1]))
