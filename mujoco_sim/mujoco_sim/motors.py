# SPDX-License-Identifier: Apache-2.0
"""The torque that motors can give at a speed."""

import numpy as np

# Full torque up to this share of the no-load speed, then falling linearly to none.
FULL_TORQUE_SHARE = 0.6


class TorqueSpeedCurve:
    """
    Limits of motors with a torque limit and a no-load speed.

    A motor that drives gives its full torque up to FULL_TORQUE_SHARE of its no-load speed and
    none at it; one that brakes gives its full torque at any speed.
    """

    def __init__(self, torque: np.ndarray, speed: np.ndarray) -> None:
        """Take torque limits [N m] and no-load speeds [rad/s], both of shape (n,) and > 0."""
        self._torque = torque
        self._speed = speed
        self._slope = 1.0 / (1.0 - FULL_TORQUE_SHARE)

    def limits(self, velocity: np.ndarray) -> np.ndarray:
        """Return the least and the largest torque [N m] at joint velocities [rad/s], (n, 2)."""
        share = np.clip((1.0 - np.abs(velocity) / self._speed) * self._slope, 0.0, 1.0)
        driving = self._torque * share
        lower = np.where(velocity < 0.0, -driving, -self._torque)
        upper = np.where(velocity > 0.0, driving, self._torque)
        return np.stack((lower, upper), axis=1)
