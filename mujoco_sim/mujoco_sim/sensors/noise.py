# SPDX-License-Identifier: Apache-2.0
"""Noise of the sensors in a robot: joints and an IMU."""

from dataclasses import dataclass

import numpy as np
from wasd_core.robot_io import ImuReading
from wasd_core.robot_io import JointStates
from wasd_core.robot_io import Reading


@dataclass(frozen=True)
class SensorNoise:
    """
    Standard deviations of what the sensors add to the truth, white at each reading.

    The accelerometer also has a constant bias of `acceleration_bias` in a random direction.
    Defaults: a consumer IMU and joint encoders as on the Go2.
    """

    joint_position: float = 0.001  # [rad]
    joint_velocity: float = 0.05  # [rad/s]
    orientation: float = 0.001  # [rad]
    angular_velocity: float = 0.01  # [rad/s]
    acceleration: float = 0.1  # [m/s^2]
    acceleration_bias: float = 0.05  # [m/s^2]


class NoisySensors:
    """Adds noise to true readings; the same seed and the same readings give the same bits."""

    def __init__(self, noise: SensorNoise, seed: int) -> None:
        self._noise = noise
        self._random = np.random.default_rng(seed)
        direction = self._random.normal(size=3)
        self._bias = noise.acceleration_bias * direction / np.linalg.norm(direction)

    def measure(self, true: Reading) -> Reading:
        """Return a noisy reading of the truth."""
        noise, random = self._noise, self._random
        count = len(true.joints.position)
        joints = JointStates(
            true.joints.position + noise.joint_position * random.normal(size=count),
            true.joints.velocity + noise.joint_velocity * random.normal(size=count),
            true.joints.effort,
        )
        if true.imu is None:
            return Reading(joints, None)
        imu = ImuReading(
            turn_by(true.imu.orientation, noise.orientation * random.normal(size=3)),
            true.imu.angular_velocity + noise.angular_velocity * random.normal(size=3),
            true.imu.linear_acceleration + self._bias + noise.acceleration * random.normal(size=3),
        )
        return Reading(joints, imu)


def turn_by(orientation: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return a quaternion (w, x, y, z) turned by a small rotation vector [rad] in its own axes."""
    w, x, y, z = orientation
    a, b, c = 0.5 * rotation
    turned = np.array(
        [
            w - x * a - y * b - z * c,
            x + w * a + y * c - z * b,
            y + w * b + z * a - x * c,
            z + w * c + x * b - y * a,
        ]
    )
    return np.asarray(turned / np.linalg.norm(turned))
