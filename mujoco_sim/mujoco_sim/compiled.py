# SPDX-License-Identifier: Apache-2.0
"""Compiled motors and sensors of legs, for each physics step and each tick."""

from collections.abc import Callable
from functools import partial
import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit
from wasd_core.robot_io import FULL_TORQUE_SHARE, ImuReading, JointStates, MOST_CONTROL, Reading

# How many errors an IMU has: biases of gyro and accelerometer, and the heading's.
ERRORS = 7


class NoiseSizes(NamedTuple):
    """A robot's part of `SensorNoise`: white noise, random walk of biases, drift."""

    joint_position: float
    joint_velocity: float
    orientation: float
    angular_velocity: float
    acceleration: float
    gyro_walk: float
    acceleration_walk: float
    drifts: bool


def add_noise(
    joints: JointStates, imu: ImuReading, memory: np.ndarray, drawn: np.ndarray, elapsed: float
) -> Reading:
    """
    Return a noisy reading, `elapsed` [s] after the one before.

    `memory` (15,) are errors of gyro and accelerometer (3,), and of the heading [rad], which go on
    until now, then a `NoiseSizes`. `drawn` (2n + 15,) from a normal distribution are the white
    noises of n joints' positions and velocities and of the IMU, and 6 steps of the biases.
    """
    position, velocity, effort = joints
    count = len(position)
    out = np.empty(2 * count + 10)
    _add_noise(position, velocity, *imu, memory, drawn, elapsed, out)
    turned, rest = out[2 * count : 2 * count + 4], 2 * count + 4
    turned /= math.hypot(*turned.tolist())
    return Reading(
        JointStates(out[:count], out[count : 2 * count], effort),
        ImuReading(turned, out[rest : rest + 3], out[rest + 3 :]),
    )


@jit
def _add_noise(
    position: np.ndarray,
    velocity: np.ndarray,
    orientation: np.ndarray,
    omega: np.ndarray,
    acceleration: np.ndarray,
    memory: np.ndarray,
    drawn: np.ndarray,
    elapsed: float,
    out: np.ndarray,
) -> None:
    """Write joints, orientation, not yet of unit length, angular velocity and acceleration."""
    m = memory[ERRORS:]
    own = NoiseSizes(m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7] != 0.0)
    count = len(position)
    for i in range(count):
        out[i] = position[i] + own.joint_position * drawn[i]
        out[count + i] = velocity[i] + own.joint_velocity * drawn[count + i]
    gyro_bias, bias, heading = memory[:3], memory[3:6], memory[6:7]
    white, steps = drawn[2 * count : 2 * count + 9], drawn[2 * count + 9 :]
    out = out[2 * count :]
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
        self.command = command
        self._curve = np.stack((torque, at_rest, at_rest / speed))
        count = len(torque)  # what compiles is loaded before the first step
        self.limits(np.zeros(count))
        command(np.zeros((5, count)), torque, np.zeros((count, 3))[:, 1:], np.zeros(count))

    def limits(self, velocity: np.ndarray) -> np.ndarray:
        """Return the least and the largest torque [N m] at joint velocities [rad/s], (n, 2)."""
        count = len(velocity)
        limits, none = np.empty((count, 2)), np.zeros(count)
        _follow(self._curve, velocity, np.arange(count), limits, none, none)
        return limits

    def follower(self, *memory: np.ndarray) -> Callable[[], None]:
        """
        Return a function that writes `limits` (n, 2) of motors that turn at `velocity[motors]`.

        It raises `peak` (n,) to the size of their `effort` (n,). `memory` are velocity, motors,
        limits, effort and peak: bound arguments make a call faster.
        """
        return partial(_follow, self._curve, *memory)


@jit
def command(
    parts: np.ndarray, strength: np.ndarray, gains: np.ndarray, controls: np.ndarray
) -> None:
    """
    Write MuJoCo's `gains` (n, 2) and `controls` (n,) of motors.

    `parts` (5, n) are a `JointCommand`'s; motors of `strength` 1 give what they are told.
    """
    for i in range(len(strength)):
        kp, kd = parts[3, i], parts[4, i]
        pulls = parts[2, i] + kp * parts[0, i] + kd * parts[1, i]
        gains[i, 0], gains[i, 1] = -kp * strength[i], -kd * strength[i]
        controls[i] = min(max(pulls * strength[i], -MOST_CONTROL), MOST_CONTROL)


@jit
def _follow(
    curve: np.ndarray,
    velocity: np.ndarray,
    motors: np.ndarray,
    limits: np.ndarray,
    effort: np.ndarray,
    peak: np.ndarray,
) -> None:
    for i in range(len(motors)):
        peak[i] = max(peak[i], abs(effort[i]))
        torque, at_rest = curve[0, i], curve[1, i]
        fall = curve[2, i] * velocity[motors[i]]
        limits[i, 0] = min(max(-at_rest - fall, -torque), 0.0)
        limits[i, 1] = min(max(at_rest - fall, 0.0), torque)
