# SPDX-License-Identifier: Apache-2.0
"""Trot, driven by the sticks or by velocity commands."""

import numpy as np

from quadruped_sim.records import LegCommand
from quadruped_sim.robot_state import RobotState
from quadruped_sim.states.base import State


class Trotting(State):
    """Sticks drive: ly forward, lx right, rx turns right; full stick is the speed limit."""

    def enter(self, robot: RobotState) -> None:
        """Stand first; the command starts at zero."""
        self.trust = np.ones(4)
        self._parts.command_filter.reset()
        self._parts.locomotion.reset(robot)

    def step(self, robot: RobotState, dt: float) -> LegCommand:
        """Trot one tick."""
        self._read_command()
        command = self._parts.command_filter.step(dt)
        locomotion = self._parts.locomotion
        result = locomotion.step(robot, command, dt)
        self.trust = locomotion.trust(robot)
        return result

    def _read_command(self) -> None:
        """Ask for what the sticks say; they are latched, so there is no silence."""
        sticks, limits = self._parts.sticks.values, self._parts.command_filter.limits
        forward = limits.forward if sticks.ly > 0.0 else limits.backward
        self._parts.command_filter.request(
            forward * sticks.ly, -limits.lateral * sticks.lx, -limits.yaw * sticks.rx
        )


class MoveBase(Trotting):
    """Velocity commands drive, as long as they keep coming."""

    def _read_command(self) -> None:
        """Commands arrive by `LegController.set_velocity`."""
