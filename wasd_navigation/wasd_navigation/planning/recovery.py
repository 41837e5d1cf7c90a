# SPDX-License-Identifier: Apache-2.0
"""What a robot does that comes no nearer: back up, turn, look again."""

import math
from typing import NamedTuple

import numpy as np

from wasd_navigation.planning.parameters import DriveLimits


class Manoeuvre(NamedTuple):
    """A velocity (vx, vy, wz) for a time [s], and what it is called."""

    velocity: np.ndarray
    duration: float
    what: str


def choose(count: int, limits: DriveLimits) -> Manoeuvre:
    """Return the manoeuvre number `count`, from 0: back up and turn take turns, left and right."""
    if count % 2 == 0:
        speed = min(limits.backward, 0.15)
        return Manoeuvre(np.array((-speed, 0.0, 0.0)), 0.3 / speed, 'backing up')
    rate = 0.6 * limits.yaw * (1.0 if count % 4 == 1 else -1.0)
    return Manoeuvre(np.array((0.0, 0.0, rate)), 0.5 * math.pi / abs(rate), 'turning')
