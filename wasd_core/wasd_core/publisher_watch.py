# SPDX-License-Identifier: Apache-2.0
"""Who commands a robot by a topic, and when the last of them has gone."""

from collections.abc import Callable

from rclpy.clock import Clock
from rclpy.clock import ClockType
from rclpy.node import Node

# How often the publishers are counted [s of wall time: simulated time may stand still].
LOOK_PERIOD = 0.1


class PublisherWatch:
    """
    Calls `on_lost` when a topic that had publishers has none any more.

    What a key has set going may last longer than the key: a latched velocity, a stick. It must
    not last longer than the keyboard. DDS notices a publisher that ends at once, one whose process
    was killed when its lease runs out (20 s).
    """

    def __init__(self, node: Node, topic: str, on_lost: Callable[[], None]) -> None:
        self._node = node
        self._topic = topic
        self._on_lost = on_lost
        self._had_any = False
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(LOOK_PERIOD, self._look, clock=clock)

    def _look(self) -> None:
        has_any = self._node.count_publishers(self._topic) > 0
        if self._had_any and not has_any:
            self._on_lost()
        self._had_any = has_any
