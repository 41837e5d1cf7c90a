# SPDX-License-Identifier: Apache-2.0
"""Which way the robot looks: the IMU's heading, less what its gyro has drifted."""

import math

import numpy as np

from quadruped_sim.tuning import EstimatorParameters

# Feet that stay so near to where they were [m], seen from the base, stand still,
STILL = 0.006
# and tell the heading once they have done so for a while [s].
SETTLING = 0.25
# Standard deviation of the heading by a reading of IMU and feet [rad].
READING = 2e-3
# Beyond so many deviations between what is measured and expected of the drift rest begins again.
_MOST = 5.0
# Trust in each foot from which on they stand.
_STANDING = 0.99


_Feet = list[list[float]]  # where they are in the plane, (4, 2) [m]


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

    def reset(self, offset: float = 0.0) -> None:
        """Believe the IMU, corrected by a known `offset` [rad]."""
        self.offset = offset
        self.bias = 0.0
        self._variance = self.params.gyro_bias**2  # of the bias
        self.variance = self._tie = 0.0  # of the offset [rad^2], and its covariance with the bias
        self._feet: _Feet | None = None

    def step(self, R: np.ndarray, feet: np.ndarray, trust: np.ndarray, dt: float) -> None:
        """
        Advance by a reading: `R` (3, 3) turns base axes into the world, as the IMU says.

        `feet` (4, 3) are seen from the base, base axes [m]; `trust` (4,) says if they stand.
        """
        self.offset += dt * self.bias
        self._variance += dt * self.params.gyro_walk**2
        if min(trust.tolist()) < _STANDING:
            self._feet = None
            self.variance += dt * (2.0 * self._tie + dt * self.params.gyro_noise**2)
            self._tie += dt * self._variance
            return
        yaw = math.atan2(float(R[1, 0]), float(R[0, 0]))
        c, s = math.cos(yaw), math.sin(yaw)
        # From here on in plain numbers: numpy takes ten times as long for four feet.
        level = (feet @ R.T[:, :2] @ np.array(((c, -s), (s, c)))).tolist()
        if self._feet is None or _distance(level, self._feet) > self._still:
            self._rest(level, yaw)
        drift = math.remainder(yaw - self._yaw - self._turn(level), math.tau)
        self._time += dt
        if self._time < SETTLING:
            self._mean += (drift - self._mean) * dt / self._time
            return
        self._correct(drift - self._mean, dt)

    @property
    def drift(self) -> tuple[float, float]:
        """How far the IMU's heading is off [rad], and its rate of turn [rad/s]."""
        return self.offset, self.bias

    def _rest(self, level: _Feet, yaw: float) -> None:
        """Begin to rest with the feet here, in axes that turn with the heading."""
        self._feet, self._arms, self._yaw = level, _centred(level), yaw
        self._time = self._mean = 0.0
        self._drift = self._spread = self._cross = 0.0

    def _turn(self, level: _Feet) -> float:
        """Angle by which the base has turned over its feet since they came to rest [rad]."""
        arms = list(zip(_centred(level), self._arms, strict=True))
        a, b, c, d = [x * before[1] - y * before[0] for (x, y), before in arms]
        e, f, g, h = [(x * before[0] + y * before[1]) for (x, y), before in arms]
        return math.atan2(a + b + c + d, (e + f) + (g + h))

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


def _distance(level: _Feet, before: _Feet) -> float:
    """Return how far a foot has come along an axis at most [m]."""
    pairs = zip(level, before, strict=True)
    return max(max(abs(x - here[0]), abs(y - here[1])) for (x, y), here in pairs)


def _centred(level: _Feet) -> _Feet:
    """Return the feet as seen from their middle."""
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = level
    middle_x, middle_y = 0.25 * (ax + bx + cx + dx), 0.25 * (ay + by + cy + dy)
    return [[x - middle_x, y - middle_y] for x, y in level]
