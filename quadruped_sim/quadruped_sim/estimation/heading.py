# SPDX-License-Identifier: Apache-2.0
"""Which way the robot looks: the IMU's heading, less what its gyro has drifted."""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from quadruped_sim.algebra import flatten, view_of
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


class HeadingState(NamedTuple):
    """
    What `Heading` keeps: `offset` and `bias`, their variances and the covariance that `ties` them.

    Of a rest, if it `rests`: the `feet` (4, 2) as it began, in axes that turn with the heading
    [m], and their `arms` from their middle, the `yaw` by the IMU, for how long [s], the `mean` of
    the first readings, and the filter's `drift`, its variance, and its covariance with the bias.
    """

    feet: np.ndarray
    arms: np.ndarray
    offset: float = 0.0
    bias: float = 0.0
    bias_variance: float = 0.0
    variance: float = 0.0
    tie: float = 0.0
    rests: float = 0.0
    yaw: float = 0.0
    time: float = 0.0
    mean: float = 0.0
    drift: float = 0.0
    spread: float = 0.0
    cross: float = 0.0


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
        self._still = STILL * size
        blank = HeadingState(np.zeros((4, 2)), np.zeros((4, 2)))
        self.flat = flatten(blank)
        self._own: HeadingState = view_of(self.flat, blank)
        self.tune(params)
        self.reset()

    def tune(self, params: EstimatorParameters) -> None:
        """Take other parameters."""
        self._rules = flatten({**vars(params), 'still': self._still})

    def reset(self, offset: float = 0.0) -> None:
        """Believe the IMU, corrected by a known `offset` [rad]."""
        self.flat[:] = np.zeros_like(self.flat)
        self.flat['offset'], self.flat['bias_variance'] = offset, self._rules['gyro_bias'] ** 2

    def step(self, R: np.ndarray, feet: np.ndarray, trust: np.ndarray, dt: float) -> None:
        """
        Advance by a reading: `R` (3, 3) turns base axes into the world, as the IMU says.

        `feet` (4, 3) are seen from the base, base axes [m]; `trust` (4,) says if they stand.
        """
        if min(trust.tolist()) < _STANDING:
            _walk(self.flat, self._rules, dt)
            return
        yaw = math.atan2(R.item(3), R.item(0))
        c, s = math.cos(yaw), math.sin(yaw)
        level = feet @ R.T[:, :2] @ np.array(((c, -s), (s, c)))
        _stand(self.flat, self._rules, level, yaw, dt)

    @property
    def offset(self) -> float:
        """How far the IMU's heading is off [rad]."""
        return float(self._own.offset)

    @property
    def bias(self) -> float:
        """How fast it drifts [rad/s]."""
        return float(self._own.bias)

    @property
    def variance(self) -> float:
        """Variance of the offset [rad^2]."""
        return float(self._own.variance)

    @property
    def drift(self) -> tuple[float, float]:
        """How far the IMU's heading is off [rad], and its rate of turn [rad/s]."""
        return self.offset, self.bias


@jit
def _walk(flat: np.ndarray, rules: np.ndarray, dt: float) -> None:
    """Advance without a foot to hold the heading by: the offset is known less and less."""
    own = flat[0]
    _go_on(flat, rules, dt)
    own.rests = 0.0
    own.variance += dt * (2.0 * own.tie + dt * rules[0].gyro_noise ** 2)
    own.tie += dt * own.bias_variance


@jit
def _stand(flat: np.ndarray, rules: np.ndarray, level: np.ndarray, yaw: float, dt: float) -> None:
    """Advance on four feet that are at `level` (4, 2) [m], in axes turned by `yaw` [rad]."""
    own = flat[0]
    _go_on(flat, rules, dt)
    if own.rests == 0.0 or _distance(level, own.feet) > rules[0].still:
        _rest(flat, level, yaw)
    turned = yaw - own.yaw - _turn(level, own.arms)
    drift = turned - math.tau * round(turned / math.tau)
    own.time += dt
    if own.time < SETTLING:
        own.mean += (drift - own.mean) * dt / own.time
    else:
        _correct(flat, rules, drift - own.mean, dt)


@jit
def _go_on(flat: np.ndarray, rules: np.ndarray, dt: float) -> None:
    """Let the offset drift by the bias, which is known less and less."""
    own = flat[0]
    own.offset += dt * own.bias
    own.bias_variance += dt * rules[0].gyro_walk ** 2


@jit
def _rest(flat: np.ndarray, level: np.ndarray, yaw: float) -> None:
    """Begin to rest with the feet here."""
    own = flat[0]
    x, y = _middle(level)
    for leg in range(4):
        own.feet[leg, 0], own.feet[leg, 1] = level[leg, 0], level[leg, 1]
        own.arms[leg, 0], own.arms[leg, 1] = level[leg, 0] - x, level[leg, 1] - y
    own.rests, own.yaw = 1.0, yaw
    own.time = own.mean = own.drift = own.spread = own.cross = 0.0


@jit
def _turn(level: np.ndarray, arms: np.ndarray) -> float:
    """Angle by which the base has turned over its feet since they came to rest [rad]."""
    middle_x, middle_y = _middle(level)
    sines, cosines = np.empty(4), np.empty(4)
    for leg in range(4):
        x, y = level[leg, 0] - middle_x, level[leg, 1] - middle_y
        sines[leg] = x * arms[leg, 1] - y * arms[leg, 0]
        cosines[leg] = x * arms[leg, 0] + y * arms[leg, 1]
    return math.atan2(
        sines[0] + sines[1] + sines[2] + sines[3],
        (cosines[0] + cosines[1]) + (cosines[2] + cosines[3]),
    )


@jit
def _correct(flat: np.ndarray, rules: np.ndarray, measured: float, dt: float) -> None:
    """Predict drift and bias, and take what is `measured` of the drift [rad]."""
    own = flat[0]
    own.drift += dt * own.bias
    own.spread += dt * (2.0 * own.cross + dt * rules[0].gyro_noise ** 2)
    own.cross += dt * own.bias_variance
    share = 1.0 / (own.spread + READING**2)
    innovation = measured - own.drift
    if innovation * innovation > _MOST**2 / share:  # no gyro drifts so, the robot turns
        own.rests = 0.0
        return
    correction = own.spread * share * innovation
    own.drift += correction
    own.offset += correction  # the prediction is in it already
    own.bias += own.cross * share * innovation
    known = own.cross * own.cross * share / max(own.bias_variance, 1e-12)
    own.bias_variance -= known * own.bias_variance
    own.tie -= known * own.tie
    own.cross -= own.spread * own.cross * share
    own.spread -= own.spread * own.spread * share


@jit
def _distance(level: np.ndarray, before: np.ndarray) -> float:
    """Return how far a foot has come along an axis at most [m]."""
    most = 0.0
    for leg in range(4):
        for axis in range(2):
            most = max(most, abs(level[leg, axis] - before[leg, axis]))
    return most


@jit
def _middle(level: np.ndarray) -> tuple[float, float]:
    """Return the middle of the feet."""
    return (
        0.25 * (level[0, 0] + level[1, 0] + level[2, 0] + level[3, 0]),
        0.25 * (level[0, 1] + level[1, 1] + level[2, 1] + level[3, 1]),
    )
