# SPDX-License-Identifier: Apache-2.0
"""Path of a foot through the air: minimum jerk along the ground, up and down in two halves."""

import numpy as np

from quadruped_sim.jit import jit


@jit
def minimum_jerk(s: float) -> tuple[float, float, float]:
    """Quintic from 0 to 1 over s in [0, 1], and two derivatives; it rests at both ends."""
    value = s * s * s * (10.0 + s * (-15.0 + 6.0 * s))
    slope = 30.0 * s * s * (1.0 - s) ** 2
    curve = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)
    return value, slope, curve


@jit
def swing_point(
    start: np.ndarray, end: np.ndarray, height: float, phase: float, duration: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Foot on its way from `start` to `end`, both (3,) [m], at `phase` in [0, 1] of `duration` [s].

    Returns position [m], velocity [m/s] and acceleration [m/s^2], each (3,). The foot passes
    `height` [m] above the higher of the two ends at half time and lands at rest.
    """
    s = min(max(phase, 0.0), 1.0)
    rate = 1.0 / duration
    value, slope, curve = minimum_jerk(s)
    position, velocity, acceleration = np.empty(3), np.empty(3), np.empty(3)
    for k in range(2):
        travel = end[k] - start[k]
        position[k] = start[k] + value * travel
        velocity[k] = slope * rate * travel
        acceleration[k] = curve * rate * rate * travel

    low, high = start[2], end[2]
    top = max(low, high) + height
    if s < 0.5:
        value, slope, curve = minimum_jerk(2.0 * s)
        base, rise = low, top - low
    else:
        value, slope, curve = minimum_jerk(2.0 * s - 1.0)
        base, rise = top, high - top
    position[2] = base + value * rise
    velocity[2] = 2.0 * slope * rate * rise
    acceleration[2] = 4.0 * curve * rate * rate * rise
    return position, velocity, acceleration
