# SPDX-License-Identifier: Apache-2.0
"""Leans and crouches with the sticks while the four feet stay where they are."""

import math

import numpy as np

from quadruped_sim.leg_kinematics import all_leg_angles
from quadruped_sim.leg_kinematics import foot_positions
from quadruped_sim.records import LegCommand
from quadruped_sim.robot_state import RobotState
from quadruped_sim.rotations import matrix_from_rpy
from quadruped_sim.rotations import rotation_vector
from quadruped_sim.states.base import approach
from quadruped_sim.states.base import State
from quadruped_sim.states.fixed_stand import stiff_command

# Roll, pitch, yaw [rad] and height [m] at full stick, on the Go2.
_FULL = np.array((math.radians(20.0), math.radians(15.0), math.radians(20.0), 0.04))
# How fast they follow the sticks, per second: unitree_guide jumps.
_RATE = np.array((0.7, 0.7, 0.7, 0.08))


class FreeStand(State):
    """
    Inverse kinematics over feet that stay: lx rolls, ly pitches, rx yaws, ry lifts.

    The feet are balls, so their centres roll as the calves lean; led to fixed points instead, they
    turn the robot 10 % further than asked.
    """

    def enter(self, robot: RobotState) -> None:
        """Keep the feet as they stand, seen from the base."""
        self._angles = robot.joint_position.copy()
        self._feet = foot_positions(self._parts.model.geometry, self._angles)
        self._calves = _calf_rotations(self._angles)
        self._now = np.zeros(4)

    def step(self, robot: RobotState, dt: float) -> LegCommand:
        """Joint angles for the present lean."""
        sticks = self._parts.sticks.values
        wanted = _FULL * np.array((sticks.lx, sticks.ly, -sticks.rx, sticks.ry))
        size = np.array((1.0, 1.0, 1.0, self._parts.model.scale.of('m')))
        self._now = approach(self._now, wanted * size, dt * _RATE * size)
        roll, pitch, yaw, lift = self._now.tolist()
        R = matrix_from_rpy(roll, pitch, yaw)
        feet = (self._feet + self._rolled(R) - np.array((0.0, 0.0, lift))) @ R
        position = all_leg_angles(self._parts.model.geometry, feet)
        limits = self._parts.model.limits
        self._angles = np.clip(position, limits.lower, limits.upper)
        return stiff_command(self._parts.model, self._angles.copy())

    def _rolled(self, R: np.ndarray) -> np.ndarray:
        """How far the centres of the feet have rolled since entry (4, 3) [m], base at entry."""
        x, y = np.zeros(4), np.zeros(4)
        for leg, (now, before) in enumerate(
            zip(_calf_rotations(self._angles), self._calves, strict=True)
        ):
            x[leg], y[leg], _ = rotation_vector(R @ now @ before.T).tolist()
        radius = self._parts.model.geometry.foot_radius
        return radius * np.column_stack((y, -x, np.zeros(4)))


def _calf_rotations(angles: np.ndarray) -> list[np.ndarray]:
    """Rotations (3, 3) from the calves to the base."""
    return [
        matrix_from_rpy(hip, 0.0, 0.0) @ matrix_from_rpy(0.0, thigh + calf, 0.0)
        for hip, thigh, calf in angles.reshape(4, 3).tolist()
    ]
