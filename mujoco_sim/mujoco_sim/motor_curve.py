# SPDX-License-Identifier: Apache-2.0
"""What torque a motor has at a speed; compiled, as it is asked for in each physics step."""

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
        self.limits(np.zeros(len(torque)))  # loaded before the first step

    def limits(self, velocity: np.ndarray) -> np.ndarray:
        """Return the least and the largest torque [N m] at joint velocities [rad/s], (n, 2)."""
        limits = np.empty((len(velocity), 2))
        self.write_limits(velocity, np.arange(len(velocity)), limits)
        return limits

    def write_limits(self, velocity: np.ndarray, motors: np.ndarray, limits: np.ndarray) -> None:
        """Write `limits` (n, 2) of those that turn at `velocity[motors]`."""
        _write_limits(self._curve, velocity, motors, limits)


@jit
def _write_limits(
    curve: np.ndarray, velocity: np.ndarray, motors: np.ndarray, limits: np.ndarray
) -> None:
    for i in range(len(motors)):
        torque, at_rest = curve[0, i], curve[1, i]
        fall = curve[2, i] * velocity[motors[i]]
        limits[i, 0] = min(max(-at_rest - fall, -torque), 0.0)
        limits[i, 1] = min(max(at_rest - fall, 0.0), torque)
