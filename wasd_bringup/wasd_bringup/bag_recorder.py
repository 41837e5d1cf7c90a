# SPDX-License-Identifier: Apache-2.0
"""`--record`: every topic of a run into one MCAP file, on simulated time."""

from collections.abc import Callable, Mapping
import math
from pathlib import Path
import time
from typing import Any

from rclpy.duration import Infinite
from rclpy.qos import QoSProfile
from std_msgs.msg import String
from wasd_core.output_file import OutputFile
import yaml

from wasd_bringup.bag_writer import BagWriter
from wasd_bringup.errors import RecordingError
from wasd_bringup.message_definitions import full_definition
from wasd_bringup.publisher_tap import PublisherTap
from wasd_bringup.publisher_tap import to_bytes

# The file on disk is at most so much older than the run [s of wall time].
SAVE_PERIOD = 0.5
# What happens to a run from outside and is no message: 'reset'.
EVENTS = '/wasd/events'


class BagRecorder:
    """
    Writes what is published in this process from its construction to `close`.

    `now` returns simulated time [ns]; set it once there is a simulation. The first failure to
    write raises RecordingError where the message was published; from then on nothing is recorded.
    """

    def __init__(self, path: Path | OutputFile, run: Mapping[str, str]) -> None:
        """
        Begin a recording; `run` says what was asked for. The file is replaced by the first save.

        Raises:
            RecordingError: the file cannot be written.
        """
        self.now: Callable[[], int] = lambda: 0
        self._writer: BagWriter | None = BagWriter(path, run)
        self._channels: dict[tuple[str, str], int] = {}
        self._saved_at = -math.inf
        self._tap = PublisherTap(self._write)

    def event(self, what: str) -> None:
        """Record something that is no message."""
        message = String(data=what)
        self._write(EVENTS, 'std_msgs/msg/String', QoSProfile(depth=1), to_bytes(message))

    def save_if_due(self) -> None:
        """
        Bring the file up to date when it is too old; call it also while nothing is published.

        Raises:
            RecordingError: the disk is full, or the like.
        """
        now = time.monotonic()
        if self._writer is not None and now - self._saved_at >= SAVE_PERIOD:
            self._saved_at = now
            self._guarded(self._writer.save)

    def close(self) -> None:
        """
        Finish the file.

        Raises:
            RecordingError: the disk is full, or the like.
        """
        self._tap.remove()
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.close()

    def discard(self) -> None:
        """End without having recorded: there was no run. What was never saved is not."""
        self._tap.remove()
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.abandon()

    def _write(self, topic: str, kind: str, profile: QoSProfile, data: bytes) -> None:
        writer = self._writer
        if writer is None:
            return
        channel = self._channels.get((topic, kind))
        if channel is None:
            channel = writer.add_channel(topic, kind, full_definition(kind), qos_text(profile))
            self._channels[topic, kind] = channel
        self._guarded(lambda: writer.write(channel, self.now(), data))

    def _guarded(self, act: Callable[[], None]) -> None:
        try:
            act()
        except RecordingError:
            # Once is enough: stopping the robot publishes, too.
            writer, self._writer = self._writer, None
            if writer is not None:
                writer.abandon()
            raise


def qos_text(profile: QoSProfile) -> str:
    """Return a quality of service as rosbag2 writes it into a recording."""
    return yaml.safe_dump(
        [
            {
                'history': profile.history.name.lower(),
                'depth': profile.depth,
                'reliability': profile.reliability.name.lower(),
                'durability': profile.durability.name.lower(),
                'deadline': _seconds(profile.deadline),
                'lifespan': _seconds(profile.lifespan),
                'liveliness': profile.liveliness.name.lower(),
                'liveliness_lease_duration': _seconds(profile.liveliness_lease_duration),
                'avoid_ros_namespace_conventions': profile.avoid_ros_namespace_conventions,
            }
        ],
        sort_keys=False,
    )


def _seconds(duration: Any) -> dict[str, int]:
    nanoseconds = duration.nanoseconds or Infinite.nanoseconds
    return {'sec': nanoseconds // 10**9, 'nsec': nanoseconds % 10**9}
