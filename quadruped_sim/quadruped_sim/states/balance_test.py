# SPDX-License-Identifier: Apache-2.0
"""Moves the base over four standing feet by forces alone."""

import math

import numpy as np

from quadruped_sim.records import LegCommand
from quadruped_sim.robot_state import RobotState
from quadruped_sim.stander import stand_command
from quadruped_sim.states.base import approach
from quadruped_sim.states.base import State

# x, y, z [m] and yaw [rad] at full stick, on the Go2.
_FULL = np.array((0.05, 0.05, 0.04, math.radians(20.0)))
_RATE = np.array((0.1, 0.1, 0.08, 0.7))


class BalanceTest(State):
    """ly moves forward, lx right, ry up, rx turns right; measured from the pose at entry."""

    def enter(self, robot: RobotState) -> None:
        """Take the present pose, levelled, as the centre."""
        self._centre = robot.position.copy()
        self._yaw = float(robot.rpy[2])
        self._now = np.zeros(4)

    def step(self, robot: RobotState, dt: float) -> LegCommand:
        """Hold the pose that the sticks ask for."""
        sticks = self._parts.sticks.values
        wanted = _FULL * np.array((sticks.ly, -sticks.lx, sticks.ry, -sticks.rx))
        length = self._parts.model.scale.of('m')
        size = np.array((length, length, length, 1.0))
        self._now = approach(self._now, wanted * size, dt * _RATE * size)
        x, y, z, turn = self._now.tolist()
        c, s = math.cos(self._yaw), math.sin(self._yaw)
        position = self._centre + np.array((c * x - s * y, s * x + c * y, z))
        rpy = np.array((0.0, 0.0, self._yaw + turn))
        parts = self._parts
        return stand_command(
            parts.locomotion.whole_body,
            parts.model,
            parts.params,
            robot,
            position,
            rpy,
            np.ones(4, dtype=bool),
            robot.feet,
        )
