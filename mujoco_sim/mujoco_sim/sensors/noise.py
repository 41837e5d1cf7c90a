# SPDX-License-Identifier: Apache-2.0
"""Noise of the sensors in a robot: joints and an IMU."""

from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace
import math
from operator import add

import numpy as np
from wasd_core.robot_io import ImuReading
from wasd_core.robot_io import JointStates
from wasd_core.robot_io import Reading

# Biases and white noise of the same seed have streams of their own.
STREAM = 15


@dataclass(frozen=True)
class SensorNoise:
    """
    Standard deviations of what the sensors add to the truth, white at each reading.

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
        self._bias = (noise.acceleration_bias * _direction(self._random)).tolist()
        # A stream of its own: what is white stays the same with and without drift.
        self._walks = np.random.default_rng((seed, STREAM))
        self._gyro_bias = (noise.gyro_bias * _direction(self._walks)).tolist()
        self._heading = 0.0  # how far the heading is off [rad]
        self._time: float | None = None

    def measure(self, true: Reading, time: float = 0.0) -> Reading:
        """Return a noisy reading of the truth at a time [s], which never runs back."""
        noise = self._noise
        count = len(true.joints.position)
        white = self._random.standard_normal(2 * count + (0 if true.imu is None else 9))
        joints = JointStates(
            true.joints.position + noise.joint_position * white[:count],
            true.joints.velocity + noise.joint_velocity * white[count : 2 * count],
            true.joints.effort,
        )
        if true.imu is None:
            return Reading(joints, None)
        # In plain numbers: numpy takes ten times as long for three of them.
        a, b, c, *gyro_and_force = white[2 * count :].tolist()
        rate = [noise.angular_velocity * part for part in gyro_and_force[:3]]
        force = [noise.acceleration * part for part in gyro_and_force[3:]]
        orientation = true.imu.orientation.tolist()
        if noise.gyro_bias or noise.gyro_walk or noise.acceleration_walk:
            rate = list(map(add, rate, self._gyro_bias))
            self._drift(orientation, rate, time)
            orientation = _turned(orientation, self._heading)
        size = noise.orientation
        turned = _turn_by(orientation, (size * a, size * b, size * c))
        felt = map(add, true.imu.linear_acceleration.tolist(), self._bias)
        imu = ImuReading(
            np.array(turned),
            np.array(list(map(add, true.imu.angular_velocity.tolist(), rate))),
            np.array(list(map(add, felt, force))),
        )
        return Reading(joints, imu)

    def _drift(self, orientation: Sequence[float], rate: Sequence[float], time: float) -> None:
        """Let the heading integrate the gyro's error [rad/s], and biases walk, up to now."""
        elapsed = 0.0 if self._time is None else time - self._time
        self._time = time
        w, x, y, z = orientation
        a, b, c = rate
        # Along the vertical, in the IMU's axes.
        turn = 2.0 * (x * z - w * y) * a + 2.0 * (y * z + w * x) * b
        turn += (1.0 - 2.0 * (x * x + y * y)) * c
        self._heading += elapsed * turn
        root, noise = math.sqrt(elapsed), self._noise
        steps = [root * step for step in self._walks.standard_normal(6).tolist()]
        self._gyro_bias = _walked(self._gyro_bias, noise.gyro_walk, steps[:3])
        self._bias = _walked(self._bias, noise.acceleration_walk, steps[3:])


def _direction(random: np.random.Generator) -> np.ndarray:
    """Return a unit vector (3,) of any direction."""
    direction = random.normal(size=3)
    return np.asarray(direction / np.linalg.norm(direction))


def _walked(bias: Sequence[float], size: float, steps: Sequence[float]) -> list[float]:
    return [part + size * step for part, step in zip(bias, steps, strict=True)]


def _turned(orientation: Sequence[float], heading: float) -> tuple[float, ...]:
    """Return a quaternion (w, x, y, z) turned about the vertical [rad]."""
    c, s = math.cos(0.5 * heading), math.sin(0.5 * heading)
    w, x, y, z = orientation
    return c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w


def turn_by(orientation: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return a quaternion (w, x, y, z) turned by a small rotation vector [rad] in its own axes."""
    return np.array(_turn_by(orientation.tolist(), rotation.tolist()))


def _turn_by(orientation: Sequence[float], rotation: Sequence[float]) -> list[float]:
    w, x, y, z = orientation
    a, b, c = [0.5 * part for part in rotation]
    turned = (
        w - x * a - y * b - z * c,
        x + w * a + y * c - z * b,
        y + w * b + z * a - x * c,
        z + w * c + x * b - y * a,
    )
    length = math.hypot(*turned)
    return [part / length for part in turned]
