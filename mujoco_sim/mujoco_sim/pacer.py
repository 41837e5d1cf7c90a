# SPDX-License-Identifier: Apache-2.0
"""Real-time pacing: how far simulated time may go at a given wall time."""

# A host that lags more than this [s] is not asked to catch up: the robot just runs slower.
MAXIMUM_LAG = 0.1
# The factor is measured over no less than this [s]: shorter, a single physics step would show.
MINIMUM_INTERVAL = 0.5


class Pacer:
    """
    Ties simulated time to wall time by a factor, and measures the factor reached.

    It is told both times [s] and reads no clock. `speed` 0 means as fast as it goes.
    """

    def __init__(self, speed: float) -> None:
        self.speed = speed
        self._anchor: tuple[float, float] | None = None
        self._mark: tuple[float, float] | None = None
        self.real_time_factor = 0.0

    def restart(self) -> None:
        """Forget the past, e.g. after a pause."""
        self._anchor = None
        self._mark = None

    def allowed(self, wall: float, simulated: float) -> float:
        """Return the simulated time [s] that should have been reached at a wall time."""
        if self._mark is None:
            self._mark = (wall, simulated)
        if self.speed == 0.0:
            return float('inf')
        if self._anchor is None:
            self._anchor = (wall, simulated)
        target = self._anchor[1] + (wall - self._anchor[0]) * self.speed
        if target - simulated > MAXIMUM_LAG * self.speed:
            target = simulated + MAXIMUM_LAG * self.speed
            self._anchor = (wall, target)
        return target

    def wait_for(self, simulated: float, wall: float) -> float:
        """Return how long [s] to wait until a simulated time may be reached; 0 if it may now."""
        if self.speed == 0.0 or self._anchor is None:
            return 0.0
        due = self._anchor[0] + (simulated - self._anchor[1]) / self.speed
        return max(0.0, due - wall)

    def measure(self, wall: float, simulated: float) -> float:
        """
        Return the real-time factor since the last measurement or restart, and keep it.

        Within MINIMUM_INTERVAL of that it is still the factor measured last, at first 0.
        """
        if self._mark is not None and wall - self._mark[0] >= MINIMUM_INTERVAL:
            self.real_time_factor = (simulated - self._mark[1]) / (wall - self._mark[0])
            self._mark = (wall, simulated)
        return self.real_time_factor
