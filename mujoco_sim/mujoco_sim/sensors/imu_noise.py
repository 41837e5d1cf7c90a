# SPDX-License-Identifier: Apache-2.0
"""Noise and drift of an IMU, compiled: it is read in each tick of a controller."""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit
from wasd_core.robot_io import ImuReading

# Biases of gyro and accelerometer, (3,), and how far the heading is off, (1,) [rad].
ImuErrors = tuple[np.ndarray, np.ndarray, np.ndarray]


class ImuSizes(NamedTuple):
    """What an IMU has of `SensorNoise`: white noise, how its biases walk, and if it drifts."""

    orientation: float
    angular_velocity: float
    acceleration: float
    gyro_walk: float
    acceleration_walk: float
    drifts: bool


def add_noise(
    sizes: tuple[float, float, float, float, float, bool],
    true: ImuReading,
    errors: ImuErrors,
    drawn: tuple[np.ndarray, np.ndarray],
    elapsed: float,
) -> ImuReading:
    """
    Return a noisy reading, `elapsed` [s] after the one before; `errors` go on until now.

    `sizes` are `ImuSizes`, a plain tuple as all here: numba takes long to see what others hold.

    `drawn` from a normal distribution are the white noises (9,) and steps of the biases (6,).
    """
    out = np.empty(10)
    _add_noise(true[:], errors, sizes, drawn, elapsed, out)
    turned = out[:4]
    turned /= math.hypot(*turned.tolist())
    return ImuReading(turned, out[4:7], out[7:])


@jit
def _add_noise(
    true: tuple[np.ndarray, np.ndarray, np.ndarray],
    errors: ImuErrors,
    sizes: tuple[float, float, float, float, float, bool],
    drawn: tuple[np.ndarray, np.ndarray],
    elapsed: float,
    out: np.ndarray,
) -> None:
    """Write orientation, not yet of unit length, angular velocity and acceleration."""
    orientation, omega, acceleration = true
    gyro_bias, bias, heading = errors
    own, (white, steps) = ImuSizes(*sizes), drawn
    w, x, y, z = orientation[0], orientation[1], orientation[2], orientation[3]
    rate = np.empty(3)
    for k in range(3):
        rate[k] = own.angular_velocity * white[3 + k]
    if own.drifts:
        for k in range(3):
            rate[k] += gyro_bias[k]
        # The heading integrates the gyro's error along the vertical, in the IMU's axes.
        turn = 2.0 * (x * z - w * y) * rate[0] + 2.0 * (y * z + w * x) * rate[1]
        turn += (1.0 - 2.0 * (x * x + y * y)) * rate[2]
        heading[0] += elapsed * turn
        root = math.sqrt(elapsed)
        for k in range(3):
            gyro_bias[k] += own.gyro_walk * (root * steps[k])
            bias[k] += own.acceleration_walk * (root * steps[3 + k])
        c, s = math.cos(0.5 * heading[0]), math.sin(0.5 * heading[0])
        w, x, y, z = c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w
    a, b, c = (
        0.5 * (own.orientation * white[0]),
        0.5 * (own.orientation * white[1]),
        0.5 * (own.orientation * white[2]),
    )
    out[0] = w - x * a - y * b - z * c
    out[1] = x + w * a + y * c - z * b
    out[2] = y + w * b + z * a - x * c
    out[3] = z + w * c + x * b - y * a
    for k in range(3):
        out[4 + k] = omega[k] + rate[k]
        out[7 + k] = acceleration[k] + bias[k] + own.acceleration * white[6 + k]
