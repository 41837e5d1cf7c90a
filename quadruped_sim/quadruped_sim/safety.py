# SPDX-License-Identifier: Apache-2.0
"""Guards around the controller: readings, falls, commands."""

import math

import numpy as np
from wasd_core.jit import jit
from wasd_core.robot_io import JointCommand, Reading

from quadruped_sim.robot_model import JointLimits
from quadruped_sim.tuning import SafetyParameters

# Of the base's height in the stand: a robot is up from the one share on, and down below the other.
UP, DOWN = 0.7, 0.5
# So long [s] is a robot down that has fallen, and is one given to get up.
_DOWN_TIME, _RISE_TIME = 0.2, 6.0
# Readings in a row that may be broken before the controller lets go.
_BROKEN_READINGS_MAX = 3


class FallWatch:
    """
    Detects a fall of a standing robot at any tilt: onto its belly or a hip.

    State: whether it has been up, and for how long it has been down or not up yet [s]. Times are a
    Go2's; `time` is how much longer a robot's are.
    """

    def __init__(self, time: float = 1.0) -> None:
        self._time_scale = time
        self.reset()

    def reset(self) -> None:
        """Let it lie."""
        self._has_been_up, self._time = False, 0.0

    def step(self, share: float, may_be_low: bool, dt: float) -> str | None:
        """
        Return why it has fallen, or None, `dt` [s] after the step before.

        `share` is how high the hips are over the lowest foot, over that of the stand: no foot is
        below the ground, so on even ground they are no lower than that.
        """
        if may_be_low:
            self.reset()
        elif share >= DOWN and (self._has_been_up or share >= UP):
            self._has_been_up, self._time = True, 0.0
        else:
            self._time += dt / self._time_scale
        if self._has_been_up and self._time > _DOWN_TIME:
            return 'it has gone down'
        return 'it cannot get up' if self._time > _RISE_TIME else None


class Safety:
    """
    Says why the robot must go passive, and keeps NaN away from controller and motors.

    State: the last good reading and how many broken ones came since.
    """

    def __init__(self, params: SafetyParameters, limits: JointLimits) -> None:
        self.params = params
        self._limits = limits
        self.reset()

    def reset(self) -> None:
        """Forget the last reading."""
        self._last: Reading | None = None
        self.broken_in_a_row = 0

    def filter_reading(self, reading: Reading) -> Reading | None:
        """
        Return the reading, or the last good one when it holds NaN or infinity.

        None when no good one has ever come.
        """
        if _is_finite(reading):
            self._last = reading
            self.broken_in_a_row = 0
            return reading
        self.broken_in_a_row += 1
        return self._last

    def tilt(self, R: np.ndarray) -> float:
        """Angle between the base's z axis and the world's [rad]."""
        return math.acos(min(max(R.item(8), -1.0), 1.0))

    def is_fallen(self, R: np.ndarray) -> bool:
        """Whether the base is tilted too far to stand."""
        return self.tilt(R) > self.params.tilt_max

    def reason_to_let_go(
        self, R: np.ndarray | None, joint_position: np.ndarray, failures_in_a_row: int
    ) -> str | None:
        """Why the robot must go passive now, or None; without `R` it may lie."""
        if self.broken_in_a_row > _BROKEN_READINGS_MAX:
            return f'{self.broken_in_a_row} sensor readings in a row are not finite'
        if R is not None and self.is_fallen(R):
            return f'tilt {math.degrees(self.tilt(R)):.0f} deg exceeds the limit'
        limits = self._limits
        if _is_beyond(joint_position, limits.lower, limits.upper, self.params.joint_margin):
            return 'a joint is beyond its limits'
        if failures_in_a_row >= self.params.solver_failures:
            return f'{failures_in_a_row} QPs in a row failed'
        return None

    def filter_command(self, command: JointCommand) -> JointCommand | None:
        """
        Command with efforts inside the motors' limits; None instead of one with NaN.

        Do not write into it: the same object again means that nothing has changed.
        """
        parts = np.concatenate(command).reshape(5, -1)
        if not _limit(parts, self._limits.effort):
            return None
        parts.setflags(write=False)
        return JointCommand(*parts)


def _is_finite(reading: Reading) -> bool:
    return reading.imu is not None and _is_sound(*reading.joints, *reading.imu)


@jit
def _is_sound(
    position: np.ndarray,
    velocity: np.ndarray,
    effort: np.ndarray,
    orientation: np.ndarray,
    omega: np.ndarray,
    acceleration: np.ndarray,
) -> bool:
    """Whether nothing is NaN, infinite or beyond 1e150, and the quaternion is one."""
    squares = size = 0.0
    for i in range(len(position)):
        squares += position[i] ** 2 + velocity[i] ** 2 + effort[i] ** 2
    for k in range(3):
        squares += omega[k] ** 2 + acceleration[k] ** 2
    for k in range(4):
        size += orientation[k] ** 2
    return math.isfinite(squares + size) and size > 0.25


@jit
def _limit(command: np.ndarray, limit: np.ndarray) -> bool:
    """Cut the efforts to what motors have; return whether all (5, 12) is finite, below 1e150."""
    for i in range(len(limit)):
        squares = 0.0
        for part in range(5):
            squares += command[part, i] ** 2
        if not math.isfinite(squares):
            return False
        command[2, i] = min(max(command[2, i], -limit[i]), limit[i])
    return True


@jit
def _is_beyond(position: np.ndarray, lower: np.ndarray, upper: np.ndarray, margin: float) -> bool:
    """Whether a joint is more than `margin` [rad] outside its limits."""
    for i in range(len(position)):
        if position[i] < lower[i] - margin or position[i] > upper[i] + margin:
            return True
    return False
