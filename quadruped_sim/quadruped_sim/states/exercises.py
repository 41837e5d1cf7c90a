# SPDX-License-Identifier: Apache-2.0
"""
unitree_guide's three tests of the whole-body QP, keys 0, 9 and 8: balance, swing, step.

All lengths and speeds here are the Go2's.
"""

import math

import numpy as np
from wasd_core.robot_io import JointCommand
from wasd_core.rotations import yaw_matrix

from quadruped_sim.leg_kinematics import FR
from quadruped_sim.leg_kinematics import FRONT
from quadruped_sim.leg_kinematics import LEFT
from quadruped_sim.robot_state import RobotState
from quadruped_sim.states.driving import approach
from quadruped_sim.states.driving import State

# x, y, z [m] and yaw [rad] of the base at full stick, and how fast it follows, per second.
BALANCE_FULL = np.array((0.05, 0.05, 0.04, math.radians(20.0)))
BALANCE_RATE = np.array((0.1, 0.1, 0.08, 0.7))
# Box of the foot around where it stood, yaw frame [m]: backward/forward, right/left, down/up;
# its speed [m/s].
SWING_LOW = np.array((-0.15, -0.15, -0.05))
SWING_HIGH = np.array((0.10, 0.15, 0.20))
SWING_FOOT_RATE = 0.3
# Shift of the base away from a lifted foot, over the three that stand [m]; its speed [m/s].
SHIFT = (0.045, 0.035)
SWING_SHIFT_RATE = 0.06
# The foot leaves the ground by this much once the base is so close to its place [m].
SWING_CLEARANCE = 0.03
SWING_CLOSE = 0.015
# Legs that are lifted in turn, FR RL FL RR; times [s], and half of how high a foot goes [m].
STEP_ORDER = (1, 2, 0, 3)
STEP_SHIFT_TIME = 1.0
STEP_LIFT_TIME = 1.0
STEP_HALF_HEIGHT = 0.05


class Exercise(State):
    """Starts from where base and feet are, level."""

    def enter(self, robot: RobotState) -> None:
        """Remember where base and feet are."""
        self._centre = robot.base.position.copy()
        self._yaw = float(robot.base.rpy[2])
        self._feet = robot.feet.copy()
        self._size = self._parts.model.scale.of('m')
        self.trust = np.ones(4)


class BalanceTest(Exercise):
    """
    Moves the base over four standing feet by forces alone, around the pose at entry.

    ly moves forward, lx right, ry up, rx turns right.
    """

    def enter(self, robot: RobotState) -> None:
        """Take the present pose, levelled, as the centre."""
        super().enter(robot)
        self._now = np.zeros(4)

    def step(self, robot: RobotState, dt: float) -> JointCommand:
        """Hold the pose that the sticks ask for."""
        sticks = self._parts.sticks.values
        wanted = BALANCE_FULL * np.array((sticks.ly, -sticks.lx, sticks.ry, -sticks.rx))
        size = np.array((self._size, self._size, self._size, 1.0))
        self._now = approach(self._now, wanted * size, dt * BALANCE_RATE * size)
        x, y, z, turn = self._now.tolist()
        c, s = math.cos(self._yaw), math.sin(self._yaw)
        position = self._centre + np.array((c * x - s * y, s * x + c * y, z))
        is_stance = np.ones(4, dtype=bool)
        return self._stand(robot, position, self._yaw + turn, is_stance, robot.feet)


class SwingTest(Exercise):
    """Stands on FL, RL and RR, over which the base moves first; ly, lx, ry move the FR foot."""

    def enter(self, robot: RobotState) -> None:
        """Remember where base and feet are."""
        super().enter(robot)
        self._shift = np.zeros(3)
        self._foot = np.zeros(3)

    def step(self, robot: RobotState, dt: float) -> JointCommand:
        """Shift, then swing."""
        size = self._size
        shift = size * np.array((*_away_from(FR), 0.0))
        self._shift = approach(self._shift, shift, np.full(3, dt * size * SWING_SHIFT_RATE))
        Rz = yaw_matrix(self._yaw)
        position = self._centre + Rz @ self._shift
        off = (robot.base.position - position)[:2]
        is_stance = np.ones(4, dtype=bool)
        is_shifted = bool((self._shift == shift).all())
        is_close = math.hypot(*off.tolist()) < size * SWING_CLOSE
        if self.trust[FR] == 0.0 or (is_shifted and is_close):
            is_stance[FR] = False
            self.trust = np.array((1.0, 0.0, 1.0, 1.0))
            most = np.full(3, dt * size * SWING_FOOT_RATE)
            self._foot = approach(self._foot, size * self._wanted(), most)
        feet = self._feet.copy()
        feet[FR] += Rz @ self._foot
        return self._stand(robot, position, self._yaw, is_stance, feet)

    def _wanted(self) -> np.ndarray:
        sticks = self._parts.sticks.values
        stick = np.array((sticks.ly, -sticks.lx, sticks.ry))
        wanted = np.where(stick > 0.0, stick * SWING_HIGH, -stick * SWING_LOW)
        wanted[2] = max(float(wanted[2]) + SWING_CLEARANCE, 0.0)
        return np.asarray(wanted)


class StepTest(Exercise):
    """
    Lifts one foot after the other by 10 cm, the base moving over the three that stand.

    Height h(t) = 0.05 (1 - cos), as unitree_guide's.
    """

    def enter(self, robot: RobotState) -> None:
        """Remember where base and feet are."""
        super().enter(robot)
        self._time = 0.0

    def step(self, robot: RobotState, dt: float) -> JointCommand:
        """Shift the base for a time, then lift and lower one foot."""
        self._time += dt
        turn, time = divmod(self._time, STEP_SHIFT_TIME + STEP_LIFT_TIME)
        leg = STEP_ORDER[int(turn) % 4]
        size = self._size
        before = size * _away_from(STEP_ORDER[(int(turn) - 1) % 4]) if turn >= 1.0 else np.zeros(2)
        share = min(time / STEP_SHIFT_TIME, 1.0)
        share = share * share * (3.0 - 2.0 * share)
        shift = before + share * (size * _away_from(leg) - before)

        is_stance = np.ones(4, dtype=bool)
        feet = self._feet.copy()
        if time > STEP_SHIFT_TIME:
            is_stance[leg] = False
            angle = 2.0 * math.pi * (time - STEP_SHIFT_TIME) / STEP_LIFT_TIME
            feet[leg, 2] += size * STEP_HALF_HEIGHT * (1.0 - math.cos(angle))
        else:
            self._feet[robot.is_contact] = robot.feet[robot.is_contact]
        self.trust = is_stance.astype(float)
        position = self._centre + yaw_matrix(self._yaw) @ np.array((*shift, 0.0))
        return self._stand(robot, position, self._yaw, is_stance, feet)


def _away_from(leg: int) -> np.ndarray:
    return np.array((-FRONT[leg] * SHIFT[0], -LEFT[leg] * SHIFT[1]))
