# SPDX-License-Identifier: Apache-2.0
"""Noise of the sensors in a robot: joints and an IMU."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from wasd_core.robot_io import JointStates, Reading

# Biases and white noise of the same seed have streams of their own.
STREAM = 15
# So many readings' noise is drawn at once, in the order in which single ones would draw it.
_DRAWN = 64


@dataclass(frozen=True)
class SensorNoise:
    """
    Standard deviations of the sensors' white noise.

    The accelerometer also has a constant bias of `acceleration_bias` in a random direction.
    Defaults: a consumer IMU and joint encoders as on the Go2.

    Gyro and accelerometer drift besides, the gyro from a bias of `gyro_bias` in a random direction
    on: biases walk at random, by `gyro_walk` and `acceleration_walk` in a second. An IMU knows by
    gravity how it is tilted, but its heading integrates the gyro and drifts with it. Defaults: a
    good MEMS, which found its bias to a degree a minute when it was switched on.
    """

    joint_position: float = 0.001  # [rad]
    joint_velocity: float = 0.05  # [rad/s]
    orientation: float = 0.001  # [rad]
    angular_velocity: float = 0.01  # [rad/s]
    acceleration: float = 0.1  # [m/s^2]
    acceleration_bias: float = 0.05  # [m/s^2]
    gyro_bias: float = 3e-4  # [rad/s]
    gyro_walk: float = 5e-6  # [rad/s per root second]
    acceleration_walk: float = 5e-4  # [m/s^2 per root second]

    def drifting(self, scale: float) -> 'SensorNoise':
        """Return the same noise with so many times the drift; 0 is none."""
        drifts = ('gyro_bias', 'gyro_walk', 'acceleration_walk')
        return replace(self, **{name: scale * getattr(self, name) for name in drifts})


class NoisySensors:
    """Adds noise to true readings; the same seed and the same readings give the same bits."""

    def __init__(self, noise: SensorNoise, seed: int) -> None:
        self._noise = noise
        self._random = np.random.default_rng(seed)
        bias = noise.acceleration_bias * _direction(self._random)
        # A stream of its own: what is white stays the same with and without drift.
        self._walks = np.random.default_rng((seed, STREAM))
        # Biases of gyro and accelerometer, (3,), and how far the heading is off [rad].
        self._errors = np.array((*(noise.gyro_bias * _direction(self._walks)), *bias, 0.0))
        self._drifts = bool(noise.gyro_bias or noise.gyro_walk or noise.acceleration_walk)
        self._add: Callable[..., Reading] | None = None
        self._coming: list[np.ndarray] = []  # drawn, the next one last

    def measure(self, true: Reading, elapsed: float = 0.0) -> Reading:
        """Return a noisy reading of the truth, `elapsed` [s] after the one before."""
        if true.imu is None:  # of wheels, which would wait at each start for what compiles
            noise, count = self._noise, len(true.joints.position)
            white = self._random.standard_normal(2 * count)
            joints = JointStates(
                true.joints.position + noise.joint_position * white[:count],
                true.joints.velocity + noise.joint_velocity * white[count : 2 * count],
                true.joints.effort,
            )
            return Reading(joints, None)
        if self._add is None:
            # Here, because only legs have an IMU, and what compiles takes a while to load.
            from mujoco_sim.compiled import add_noise, NoiseSizes

            noise = self._noise
            imu = noise.orientation, noise.angular_velocity, noise.acceleration
            drift = noise.gyro_walk, noise.acceleration_walk, self._drifts
            sizes = NoiseSizes(noise.joint_position, noise.joint_velocity, *imu, *drift)
            self._add, self._memory = add_noise, np.array((*self._errors, *sizes))
        if not self._coming:
            self._coming = self._draw(2 * len(true.joints.position) + 9)
        return self._add(true.joints, true.imu, self._memory, self._coming.pop(), elapsed)

    def _draw(self, count: int) -> list[np.ndarray]:
        """Return the white noises and the 6 steps of the biases of readings, (count + 6,)."""
        white = self._random.standard_normal((_DRAWN, count))
        steps = self._walks.standard_normal((_DRAWN, 6)) if self._drifts else np.zeros((_DRAWN, 6))
        return list(np.hstack((white, steps))[::-1])


def _direction(random: np.random.Generator) -> np.ndarray:
    """Return a unit vector (3,) of any direction."""
    direction = random.normal(size=3)
    return np.asarray(direction / np.linalg.norm(direction))
