# SPDX-License-Identifier: Apache-2.0
"""Motors whose torque depends on their speed; compiled, as each physics step asks for it."""

import numpy as np
from wasd_core.jit import jit
from wasd_core.robot_io import FULL_TORQUE_SHARE


class TorqueSpeedCurve:
    """
    Limits of motors with a torque limit and a no-load speed.

    A motor that drives gives its full torque up to FULL_TORQUE_SHARE of its no-load speed and
    none at it; one that brakes gives its full torque at any speed.
    """

    def __init__(self, torque: np.ndarray, speed: np.ndarray) -> None:
        """Take torque limits [N m] and no-load speeds [rad/s], both of shape (n,) and > 0."""
        # The falling line of one that drives forward, or backward, goes on until it is cut.
        at_rest = torque / (1.0 - FULL_TORQUE_SHARE)
        self._curve = np.stack((torque, at_rest, at_rest / speed))
        count = len(torque)  # what compiles is loaded before the first step
        self.limits(np.zeros(count))
        self.command(np.zeros((5, count)), torque, np.zeros((count, 3))[:, 1:], np.zeros(count))

    def limits(self, velocity: np.ndarray) -> np.ndarray:
        """Return the least and the largest torque [N m] at joint velocities [rad/s], (n, 2)."""
        limits = np.empty((len(velocity), 2))
        self.write_limits(velocity, np.arange(len(velocity)), limits)
        return limits

    def write_limits(self, velocity: np.ndarray, motors: np.ndarray, limits: np.ndarray) -> None:
        """Write `limits` (n, 2) of those that turn at `velocity[motors]`."""
        _write_limits(self._curve, velocity, motors, limits)

    def command(
        self, parts: np.ndarray, strength: np.ndarray, gains: np.ndarray, controls: np.ndarray
    ) -> None:
        """
        Write MuJoCo's `gains` (n, 2) and `controls` (n,) of motors.

        `parts` (5, n) are a `JointCommand`'s; motors of `strength` 1 give what they are told.
        """
        _command(parts, strength, gains, controls)


@jit
def _command(
    parts: np.ndarray, strength: np.ndarray, gains: np.ndarray, controls: np.ndarray
) -> None:
    for i in range(len(strength)):
        kp, kd = parts[3, i], parts[4, i]
        pulls = parts[2, i] + kp * parts[0, i] + kd * parts[1, i]
        gains[i, 0], gains[i, 1] = -kp * strength[i], -kd * strength[i]
        controls[i] = pulls * strength[i]


@jit
def _write_limits(
    curve: np.ndarray, velocity: np.ndarray, motors: np.ndarray, limits: np.ndarray
) -> None:
    for i in range(len(motors)):
        torque, at_rest = curve[0, i], curve[1, i]
        fall = curve[2, i] * velocity[motors[i]]
        limits[i, 0] = min(max(-at_rest - fall, -torque), 0.0)
        limits[i, 1] = min(max(at_rest - fall, 0.0), torque)
