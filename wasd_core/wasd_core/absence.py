# SPDX-License-Identifier: Apache-2.0
"""What a process that was stopped must not believe: messages that were sent meanwhile."""

from collections.abc import Callable
import math
import time

from rclpy.clock import Clock
from rclpy.clock import ClockType
from rclpy.node import Node

# A process that does nothing for so long was stopped or starved [s of wall time] ...
SHORTEST_ABSENCE = 0.5
# ... and so long after it messages from before may still come, sent again by the middleware [s].
AFTERMATH = 10.0
# How often a node shows that it lives [s of wall time].
BEAT_PERIOD = 0.1


class Absence:
    """
    Knows when this process last stood still, and whether a message was sent before it went on.

    A Twist has no stamp: out of a queue that waited for a stopped process it looks like new. The
    middleware tells when it was sent, by the clock of its sender. How far that clock is off is
    the least difference between sending and receiving seen so far. It reads no clock.
    """

    def __init__(self) -> None:
        self._lived_at = math.inf
        self._returned_at = -math.inf
        self._offset = math.inf

    def beat(self, now: float) -> float:
        """Note a sign of our own life at a time [s]; return how long we were absent [s], or 0."""
        gap, self._lived_at = now - self._lived_at, now
        if gap < SHORTEST_ABSENCE:
            return 0.0
        self._returned_at = now
        return gap

    def is_stale(self, sent: float, now: float) -> bool:
        """Whether a message that is received now was sent before our last return [s]."""
        known = self._offset if self._offset < math.inf else 0.0
        self._offset = min(self._offset, now - sent)
        since = now - self._returned_at
        return since < AFTERMATH and sent + min(known, self._offset) < self._returned_at


class AbsenceWatch:
    """An Absence on wall time for a node; `on_return` is told how long the node was away [s]."""

    def __init__(self, node: Node, on_return: Callable[[float], None] = lambda gap: None) -> None:
        self._absence = Absence()
        self._on_return = on_return
        # Nobody sets this clock: a jump would look like an absence.
        self._ahead = time.time() - time.monotonic()
        wall = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(BEAT_PERIOD, self.beat, clock=wall)

    def beat(self) -> None:
        """Show that the process lives; to be called wherever it may come back to life."""
        gap = self._absence.beat(time.monotonic())
        if gap > 0.0:
            self._on_return(gap)

    def is_stale(self, sent: int) -> bool:
        """Whether a message sent at a system time [ns] is from before the last return."""
        self.beat()
        return self._absence.is_stale(1e-9 * sent - self._ahead, time.monotonic())
