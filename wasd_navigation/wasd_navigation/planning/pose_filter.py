# SPDX-License-Identifier: Apache-2.0
"""A pose without its noise, which would shake the robot."""

import math

import numpy as np

from wasd_navigation.se2 import compose
from wasd_navigation.se2 import wrap

# Time constant in which a pose that the velocity does not explain is believed [s]; and the
# difference [m or rad] that is no noise, but another place.
_TIME, _JUMP = 0.3, 0.15


class PoseFilter:
    """`pose`, shape (3,), follows the velocity, and slowly what poses say; None at first."""

    def __init__(self) -> None:
        self.pose: np.ndarray | None = None

    def step(self, pose: np.ndarray, velocity: np.ndarray, dt: float) -> None:
        """Take a pose and the velocity in the base frame, shape (3,), after `dt` [s]."""
        if self.pose is None:
            self.pose = np.array(pose, float)
            return
        foreseen = compose(self.pose, velocity * dt)
        error = pose - foreseen
        error[2] = wrap(error[2])
        is_elsewhere = math.hypot(error[0], error[1]) > _JUMP or abs(error[2]) > _JUMP
        share = 1.0 if is_elsewhere else min(dt / _TIME, 1.0)
        blended: np.ndarray = foreseen + share * error
        self.pose = blended
