# SPDX-License-Identifier: Apache-2.0
"""SportModeState: where the robot believes to be, and what it does, as bytes."""

import numpy as np
from quadruped_sim.keys import StateName
from wasd_core.rotations import matrix_from_quaternion

from unitree_bridge.cdr import encode, Layout
from unitree_bridge.legs_robot import LegsRobot
from unitree_bridge.low_level import imu_numbers, imu_view
from unitree_bridge.robot import Senses
from unitree_bridge.shapes import SPORT_MODE_STATE

# The numbers of Unitree's modes.
_BALANCES, _LEANS, _MOVES, _LIES_DOWN, _LOCKED, _DAMPS, _GETS_UP, _JUMPS = 1, 2, 3, 5, 6, 7, 8, 12
MODES = {
    StateName.PASSIVE: _DAMPS,
    StateName.FIXED_STAND: _LOCKED,
    StateName.FREE_STAND: _LEANS,
    StateName.TROTTING: _MOVES,
    StateName.MOVE_BASE: _MOVES,
    StateName.POLICY: _MOVES,
    StateName.BALANCE_TEST: _BALANCES,
    StateName.SWING_TEST: _BALANCES,
    StateName.STEP_TEST: _BALANCES,
    StateName.GET_UP: _GETS_UP,
    StateName.LIE_DOWN: _LIES_DOWN,
    StateName.JUMP: _JUMPS,
}
_STEPPING = (StateName.TROTTING, StateName.MOVE_BASE, StateName.POLICY, StateName.STEP_TEST)


class SportStates:
    """
    Writes SportModeState messages, one after the other into the same memory.

    Position and velocity are the odometry's, in the frame in which it began; `velocity` is turned
    into that frame, as unitree_mujoco has it.
    """

    def __init__(self) -> None:
        layout = Layout(SPORT_MODE_STATE)
        self._raw = bytearray(encode(SPORT_MODE_STATE, {}))
        self._views = {
            path: layout.field(path).of(self._raw)
            for path in dict.fromkeys(place.path for place in layout.places)
            if not path.startswith('path_point.')
        }
        self._imu = imu_view(layout, self._raw)

    def write(self, robot: LegsRobot, senses: Senses) -> bytes:
        """Return the message of this instant."""
        views = self._views
        views['stamp.sec'][0] = seconds = int(robot.time)
        views['stamp.nanosec'][0] = round(1e9 * (robot.time - seconds)) % 1_000_000_000
        self._imu[:] = imu_numbers(senses)
        views['mode'][0] = MODES[robot.state]
        views['gait_type'][0] = int(robot.state in _STEPPING)
        views['body_height'][0] = robot.height
        views['foot_force'][:] = np.rint(senses.foot_force)
        views['foot_position_body'][:], views['foot_speed_body'][:] = robot.feet()
        odometry = robot.odometry
        if odometry is not None:
            turn = matrix_from_quaternion(odometry.orientation)
            views['position'][:] = odometry.position
            views['velocity'][:] = turn @ odometry.linear_velocity
            views['yaw_speed'][0] = odometry.angular_velocity[2]
        return bytes(self._raw)
