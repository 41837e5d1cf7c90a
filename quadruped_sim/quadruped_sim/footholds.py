# SPDX-License-Identifier: Apache-2.0
"""Where a foot lands: under its hip, shifted by speed and by its error [Raibert1986]."""

import math

import numpy as np

from quadruped_sim.ground import Ground
from quadruped_sim.jit import jit
from quadruped_sim.parameters import FootholdParameters


def nominal_feet(hip: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Feet below their hips in the base's yaw frame, shape (4, 3), z 0 [m]."""
    feet = hip.copy()
    feet[:, 1] += offset
    feet[:, 2] = 0.0
    return feet


def footholds(
    params: FootholdParameters,
    nominal: np.ndarray,
    position: np.ndarray,
    yaw: float,
    velocity: np.ndarray,
    command: np.ndarray,
    yaw_rate: float,
    remaining: np.ndarray,
    stance_time: float,
    ground: Ground,
    clearance: float,
) -> np.ndarray:
    """
    Landing points of the foot centres in world axes, shape (4, 3) [m].

    `nominal` (4, 3) are the feet in the yaw frame; `velocity` and `command` (3,) [m/s] the base's
    real and commanded velocity in world axes; `remaining` (4,) [s] the time to touchdown.
    `clearance` [m] is what they keep from the ground plane.
    The shift is v T/2 + gain (v - command), limited to `reach`; the yaw motion to come until
    the middle of the stance turns the nominal foot with it.
    """
    feet = _footholds(
        nominal,
        position,
        yaw,
        velocity,
        command,
        yaw_rate,
        remaining,
        stance_time,
        params.velocity_gain,
        params.reach,
    )
    feet[:, 2] = ground.heights(feet) + clearance
    return feet


@jit
def _footholds(
    nominal: np.ndarray,
    position: np.ndarray,
    yaw: float,
    velocity: np.ndarray,
    command: np.ndarray,
    yaw_rate: float,
    remaining: np.ndarray,
    stance_time: float,
    gain: float,
    reach: float,
) -> np.ndarray:
    """Landing points without height, shape (4, 3)."""
    feet = np.zeros((4, 3))
    x = 0.5 * stance_time * velocity[0] + gain * (velocity[0] - command[0])
    y = 0.5 * stance_time * velocity[1] + gain * (velocity[1] - command[1])
    length = math.sqrt(x * x + y * y)
    if length > reach:
        x *= reach / length
        y *= reach / length
    for leg in range(4):
        angle = yaw + yaw_rate * (remaining[leg] + 0.5 * stance_time)
        c, s = math.cos(angle), math.sin(angle)
        nx, ny = nominal[leg, 0], nominal[leg, 1]
        feet[leg, 0] = position[0] + remaining[leg] * velocity[0] + c * nx - s * ny + x
        feet[leg, 1] = position[1] + remaining[leg] * velocity[1] + s * nx + c * ny + y
    return feet
