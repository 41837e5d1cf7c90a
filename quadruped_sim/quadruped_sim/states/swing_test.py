# SPDX-License-Identifier: Apache-2.0
"""Stands on three legs and moves the front right foot with the sticks."""

import math

import numpy as np

from quadruped_sim.legs import FR
from quadruped_sim.records import LegCommand
from quadruped_sim.robot_state import RobotState
from quadruped_sim.rotations import yaw_matrix
from quadruped_sim.stander import stand_command
from quadruped_sim.states.base import approach
from quadruped_sim.states.base import State

# All for the Go2. Box of the foot around where it stood, yaw frame [m]: backward/forward,
# right/left, down/up.
_LOW = np.array((-0.15, -0.15, -0.05))
_HIGH = np.array((0.10, 0.15, 0.20))
_FOOT_RATE = 0.3
# Shift of the base away from the lifted foot, over the three that stand [m], and its speed [m/s].
_SHIFT = np.array((-0.045, 0.035, 0.0))
_SHIFT_RATE = 0.06
# The foot leaves the ground by this much once the base is so close to its place [m].
_CLEARANCE = 0.03
_CLOSE = 0.015


class SwingTest(State):
    """The base first moves over FL, RL and RR; then ly, lx, ry move the FR foot."""

    def enter(self, robot: RobotState) -> None:
        """Remember where base and feet are."""
        self._centre = robot.position.copy()
        self._yaw = float(robot.rpy[2])
        self._feet = robot.feet.copy()
        self._shift = np.zeros(3)
        self._foot = np.zeros(3)
        self.trust = np.ones(4)

    def step(self, robot: RobotState, dt: float) -> LegCommand:
        """Shift, then swing."""
        size = self._parts.model.scale.of('m')
        self._shift = approach(self._shift, size * _SHIFT, np.full(3, dt * size * _SHIFT_RATE))
        Rz = yaw_matrix(self._yaw)
        position = self._centre + Rz @ self._shift
        off = (robot.position - position)[:2]
        is_stance = np.ones(4, dtype=bool)
        is_shifted = bool((self._shift == size * _SHIFT).all())
        if self.trust[FR] == 0.0 or (is_shifted and math.hypot(*off.tolist()) < size * _CLOSE):
            is_stance[FR] = False
            self.trust = np.array((1.0, 0.0, 1.0, 1.0))
            self._foot = approach(
                self._foot, size * self._wanted(), np.full(3, dt * size * _FOOT_RATE)
            )
        feet = self._feet.copy()
        feet[FR] += Rz @ self._foot
        parts = self._parts
        rpy = np.array((0.0, 0.0, self._yaw))
        return stand_command(
            parts.locomotion.whole_body,
            parts.model,
            parts.params,
            robot,
            position,
            rpy,
            is_stance,
            feet,
        )

    def _wanted(self) -> np.ndarray:
        sticks = self._parts.sticks.values
        stick = np.array((sticks.ly, -sticks.lx, sticks.ry))
        wanted = np.where(stick > 0.0, stick * _HIGH, -stick * _LOW)
        wanted[2] = max(float(wanted[2]) + _CLEARANCE, 0.0)
        return np.asarray(wanted)
