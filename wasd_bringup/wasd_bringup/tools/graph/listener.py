# SPDX-License-Identifier: Apache-2.0
"""Listen to any topic of a graph."""

from collections.abc import Callable
import time
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

# The publishers are looked at so often [s].
LOOK_PERIOD = 0.2
QUEUE_DEPTH = 100


class TopicListener:
    """
    Hands the messages of a topic to `callback`; call `look` in a loop.

    It subscribes once there is a publisher, with the strongest quality of service that all of
    them offer, and again when that changes.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        kind: type[Any],
        callback: Callable[[Any], None],
        raw: bool = False,
    ) -> None:
        self._node = node
        self._topic = topic
        self._kind = kind
        self._callback = callback
        self._raw = raw
        self._profile: QoSProfile | None = None
        self._subscription: Any = None
        self._next_look = 0.0

    def look(self) -> None:
        """Subscribe as the publishers of now offer, if it is time to look."""
        now = time.monotonic()
        if now < self._next_look:
            return
        self._next_look = now + LOOK_PERIOD
        infos = self._node.get_publishers_info_by_topic(self._topic)
        profile = common_profile([info.qos_profile for info in infos])
        if not infos or profile == self._profile:
            return
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
        self._profile = profile
        self._subscription = self._node.create_subscription(
            self._kind, self._topic, self._callback, profile, raw=self._raw
        )


def common_profile(offered: list[QoSProfile]) -> QoSProfile:
    """Return the strongest quality of service that every publisher offers."""
    profile = QoSProfile(depth=QUEUE_DEPTH)
    if any(one.reliability == ReliabilityPolicy.BEST_EFFORT for one in offered):
        profile.reliability = ReliabilityPolicy.BEST_EFFORT
    if all(one.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in offered):
        profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
    return profile
