# SPDX-License-Identifier: Apache-2.0
"""Whether robots go the way that a recording says."""

from collections.abc import Mapping
import math
from typing import Any

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message

from wasd_bringup.bag_reader import BagReader
from wasd_bringup.bag_reader import RecordedMessage
from wasd_bringup.errors import RecordingError
from wasd_bringup.publisher_tap import PublisherTap


class PathComparison:
    """
    Compares each true pose that this process publishes with the recorded one.

    They are the same when their bytes are: place, orientation, velocities and stamp.
    """

    def __init__(self, bag: BagReader, topics: Mapping[str, str]) -> None:
        """
        Read the recorded poses of all robots and begin to listen; `topics` by namespace.

        Raises:
            RecordingError: there are none.
        """
        self._recorded: dict[str, list[RecordedMessage]] = {topic: [] for topic in topics.values()}
        for message in bag.messages(topics.values()):
            self._recorded[message.topic].append(message)
        self.count = sum(map(len, self._recorded.values()))
        if not self.count:
            raise RecordingError(f'{bag.path}: no ground_truth/odom in it')
        self._next = dict.fromkeys(self._recorded, 0)
        self._same = 0
        self._differs_from: float | None = None
        self._farthest = 0.0
        self._tap = PublisherTap(self._hear)

    @property
    def duration(self) -> float:
        """How long the run has to be for all of them to be published [s]."""
        last = max(messages[-1].time for messages in self._recorded.values() if messages)
        # Up to, but not including, the instant after the last.
        return 1e-9 * last + 0.001

    @property
    def is_same(self) -> bool:
        """Whether every recorded pose came again."""
        return self._same == self.count

    def verdict(self) -> str:
        """Return what came out of it, in one line."""
        text = f'{self._same} of {self.count} recorded poses are identical'
        if self._differs_from is None:
            return text
        return (
            f'{text}; the path differs from {self._differs_from:.2f} s on, '
            f'by up to {self._farthest:.4f} m'
        )

    def close(self) -> None:
        """Stop listening."""
        self._tap.remove()

    def _hear(self, topic: str, kind: str, profile: Any, data: bytes) -> None:
        recorded, index = self._recorded.get(topic, ()), self._next.get(topic, 0)
        if index >= len(recorded):
            return
        self._next[topic] += 1
        if data == recorded[index].data:
            self._same += 1
            return
        if self._differs_from is None:
            self._differs_from = 1e-9 * recorded[index].time
        self._farthest = max(self._farthest, math.dist(_place(data), _place(recorded[index].data)))


def _place(data: bytes) -> tuple[float, float, float]:
    place = deserialize_message(data, Odometry).pose.pose.position
    return place.x, place.y, place.z
