# SPDX-License-Identifier: Apache-2.0
"""Detects a robot that is slower than its steady command."""

import numpy as np

from diff_drive_sim.limits import Velocity

# After so long of a steady command [s] it is measured for so long [s].
SETTLED, MEASURED = 1.0, 1.0
# A command is steady within this share; slower ones than this [m/s at the rim] say little.
STEADY, LEAST = 0.02, 0.02
# Of the speed asked for a robot reaches so much, or it is worth a line.
ENOUGH = 0.75


class Shortfall:
    """
    Compares a robot's command with the true motion of the robot and its wheels.

    Speeds are (ahead [m/s], turn [rad/s]); a turn counts by what it makes of a wheel's speed.
    """

    def __init__(self, half_track: float) -> None:
        """Take half the distance between the wheels [m]."""
        self._weights = np.array([1.0, half_track])
        self.reset()

    def reset(self) -> None:
        """Begin a new measurement."""
        self._asked = np.zeros(2)
        self._time = self._measured = 0.0
        self._way = np.zeros((2, 2))

    def step(self, asked: Velocity, wheels: Velocity, true: Velocity, dt: float) -> str:
        """Return a line where the last seconds fell short, and nothing else; `dt` [s] went by."""
        wanted = self._weights * asked
        if np.abs(wanted - self._asked).max() > STEADY * np.abs(wanted).max():
            self.reset()
            self._asked = wanted
        if np.abs(wanted).max() < LEAST:
            return ''
        self._time += dt
        if self._time <= SETTLED:
            return ''
        self._measured += dt
        self._way += dt * self._weights * np.array([wheels, true])
        if self._measured < MEASURED:
            return ''
        turned, went = self._way @ wanted / (wanted @ wanted) / self._measured
        self.reset()
        if went >= ENOUGH:
            return ''
        slips = turned >= ENOUGH
        why = 'slip or hang in the air' if slips else 'turn too slowly, blocked or too weak'
        return f'wheels {why}: {round(100.0 * went)} % of the speed asked for'
