# SPDX-License-Identifier: Apache-2.0
"""Which way the robot looks: the IMU's heading, less what its gyro has drifted."""

import math

import numpy as np

from quadruped_sim.parameters import EstimatorParameters

# Feet that stay so near to where they were [m], seen from the base, stand still,
STILL = 0.006
# and tell the heading once they have done so for a while [s].
SETTLING = 0.25
# Standard deviation of the heading by a reading of IMU and feet [rad].
READING = 2e-3
# Beyond so many deviations between what is measured and expected of the drift rest begins anew.
_MOST = 5.0
# Trust in each foot from which on they stand.
_STANDING = 0.99


class Heading:
    """
    How far the IMU's heading is off, `offset` [rad], and how fast it drifts, `bias` [rad/s].

    An IMU knows by gravity how it is tilted, but no gravity tells its heading: that integrates
    the gyro with its bias. Four feet that stand still do not turn, so what IMU and feet say
    differently from a moment on is drift, and its rate the bias of the gyro about the vertical.
    While the robot walks, the heading drifts by as much as the bias is not known.

    At rest: a Kalman filter of drift d since then and bias b, d' = b.
    """

    def __init__(self, params: EstimatorParameters, size: float = 1.0) -> None:
        """Take a robot whose lengths are those of a Go2 times `size`."""
        self.params, self._still = params, STILL * size
        self.reset()

    def reset(self) -> None:
        """Believe the IMU."""
        self.offset = 0.0
        self.bias = 0.0
        self._variance = self.params.gyro_bias**2  # of the bias
        self.variance = self._tie = 0.0  # of the offset [rad^2], and its covariance with the bias
        self._feet: np.ndarray | None = None

    def step(self, R: np.ndarray, feet: np.ndarray, trust: np.ndarray, dt: float) -> None:
        """
        Advance by a reading: `R` (3, 3) turns base axes into the world, as the IMU says.

        `feet` (4, 3) are seen from the base, base axes [m]; `trust` (4,) says if they stand.
        """
        self.offset += dt * self.bias
        self._variance += dt * self.params.gyro_walk**2
        if float(trust.min()) < _STANDING:
            self._feet = None
            self.variance += dt * (2.0 * self._tie + dt * self.params.gyro_noise**2)
            self._tie += dt * self._variance
            return
        yaw = math.atan2(float(R[1, 0]), float(R[0, 0]))
        c, s = math.cos(yaw), math.sin(yaw)
        level = feet @ R.T[:, :2] @ np.array(((c, -s), (s, c)))
        if self._feet is None or float(np.abs(level - self._feet).max()) > self._still:
            self._rest(level, yaw)
        drift = math.remainder(yaw - self._yaw - self._turn(level), math.tau)
        self._time += dt
        if self._time < SETTLING:
            self._mean += (drift - self._mean) * dt / self._time
            return
        self._correct(drift - self._mean, dt)

    def orientation(self, quaternion: np.ndarray) -> np.ndarray:
        """Return the IMU's orientation (w, x, y, z) turned back by its drift."""
        c, s = math.cos(0.5 * self.offset), -math.sin(0.5 * self.offset)
        w, x, y, z = quaternion.tolist()
        return np.array((c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w))

    def _rest(self, level: np.ndarray, yaw: float) -> None:
        """Begin to rest with the feet here, (4, 2) [m], in axes that turn with the heading."""
        self._feet, self._yaw = level, yaw
        self._time = self._mean = 0.0
        self._drift = self._spread = self._cross = 0.0

    def _turn(self, level: np.ndarray) -> float:
        """Angle by which the base has turned over its feet since they came to rest [rad]."""
        assert self._feet is not None
        now, before = level - level.mean(axis=0), self._feet - self._feet.mean(axis=0)
        across = now[:, 0] * before[:, 1] - now[:, 1] * before[:, 0]
        return math.atan2(float(across.sum()), float((now * before).sum()))

    def _correct(self, measured: float, dt: float) -> None:
        """Predict drift and bias, and take what is `measured` of the drift [rad]."""
        self._drift += dt * self.bias
        self._spread += dt * (2.0 * self._cross + dt * self.params.gyro_noise**2)
        self._cross += dt * self._variance
        share = 1.0 / (self._spread + READING**2)
        innovation = measured - self._drift
        if innovation * innovation > _MOST**2 / share:  # no gyro drifts so, the robot turns
            self._feet = None
            return
        correction = self._spread * share * innovation
        self._drift += correction
        self.offset += correction  # the prediction is in it already
        self.bias += self._cross * share * innovation
        known = self._cross * self._cross * share / max(self._variance, 1e-12)
        self._variance -= known * self._variance
        self._tie -= known * self._tie
        self._cross -= self._spread * self._cross * share
        self._spread -= self._spread * self._spread * share
