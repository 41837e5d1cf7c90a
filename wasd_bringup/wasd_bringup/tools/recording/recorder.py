# SPDX-License-Identifier: Apache-2.0
"""`--record`: every topic of a run into one MCAP file, on simulated time."""

from collections.abc import Callable, Mapping
from functools import cache
import math
from pathlib import Path
import re
import time
from typing import Any, ClassVar

from rclpy.duration import Infinite
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from robot_description.packages import share_directory
from std_msgs.msg import String
from wasd_core.errors import one_line, UserError
from wasd_core.output_file import OutputError, OutputFile
from wasd_core.topics import LoopbackSubscription
import yaml

from wasd_bringup.tools.messages import cdr_end, type_name
from wasd_bringup.tools.recording.bag_writer import BagWriter

SEPARATOR = '=' * 80
# The type at the beginning of a field's line: package and name, or a name of the same package.
_NESTED = re.compile(r'^\s*(?:(?P<package>\w+)/(?:msg/)?)?(?P<name>[A-Z]\w*)\b', re.MULTILINE)


@cache
def full_definition(kind: str) -> str:
    """
    Return the .msg text of a type `package/msg/Name`, then those of all types in it (`ros2msg`).

    Raises:
        UserError: a definition is not where its package is installed.
    """
    package, _, name = kind.split('/')
    first = (package, name)
    texts = {first: _text(*first)}
    waiting = [first]
    while waiting:
        inside = waiting.pop(0)
        for match in _NESTED.finditer(texts[inside]):
            nested = (match['package'] or inside[0], match['name'])
            if nested not in texts:
                texts[nested] = _text(*nested)
                waiting.append(nested)
    parts = [texts.pop(first)]
    parts += [f'MSG: {"/".join(nested)}\n{text}' for nested, text in texts.items()]
    return f'\n{SEPARATOR}\n'.join(parts)


def _text(package: str, name: str) -> str:
    path = share_directory(package) / 'msg' / f'{name}.msg'
    try:
        return path.read_text(encoding='utf-8')
    except OSError as error:
        raise UserError(f'{path}: {one_line(error)}; a recording needs it') from None


# Given the topic, its type, its quality of service and the message as CDR.
Hear = Callable[[str, str, Any, bytes], None]
# Bears stamps of the wall clock and tells of nodes, not of robots.
IGNORED = '/parameter_events'


class PublisherTap:
    """
    Stands between all publishers of this process and the middleware until `remove`.

    A subscription would hear messages later, in an order of its own, and lose some at full speed;
    here they come in the order and at the simulated instant of their publishing. It counts as a
    listener of the topics that it `wants`: what is made only for listeners is made. A message that
    another process sent to one of our subscriptions is heard once, when the subscription takes it.
    Several taps hear the same bytes.
    """

    _taps: ClassVar[list['PublisherTap']] = []
    _topics: ClassVar[dict[Publisher, tuple[str, str]]] = {}
    _first: ClassVar[dict[str, LoopbackSubscription[Any]]] = {}
    _publish: ClassVar[Any] = None
    _count: ClassVar[Any] = None

    def __init__(self, hear: Hear, wants: Callable[[str], bool] = lambda topic: True) -> None:
        self._hear, self._wants = hear, wants
        publishers: Any = Publisher
        cls = PublisherTap
        if not cls._taps:
            # rclpy has no hook for this; its publishers are plain Python.
            cls._publish, cls._count = publishers.publish, publishers.get_subscription_count
            publishers.publish = lambda publisher, message: cls._on_publish(publisher, message)
            publishers.get_subscription_count = lambda publisher: cls._listeners(publisher)
            LoopbackSubscription.observers.append(cls._on_loopback)
        cls._taps.append(self)

    def remove(self) -> None:
        """Let messages pass unheard again."""
        publishers: Any = Publisher
        cls = PublisherTap
        if self not in cls._taps:
            return
        cls._taps.remove(self)
        if not cls._taps:
            publishers.publish, publishers.get_subscription_count = cls._publish, cls._count
            LoopbackSubscription.observers.remove(cls._on_loopback)
            cls._topics.clear()
            cls._first.clear()

    @classmethod
    def _name_of(cls, publisher: Any) -> tuple[str, str]:
        """Return topic and type: asking for them takes longer than publishing."""
        if publisher not in cls._topics:
            cls._topics[publisher] = publisher.topic_name, type_name(publisher.msg_type)
        return cls._topics[publisher]

    @classmethod
    def _listeners(cls, publisher: Any) -> int:
        topic, _ = cls._name_of(publisher)
        count: int = cls._count(publisher)
        return count + sum(tap._wants(topic) for tap in cls._taps)

    @classmethod
    def _on_publish(cls, publisher: Any, message: Any) -> None:
        cls._publish(publisher, message)
        topic, kind = cls._name_of(publisher)
        cls._tell(topic, kind, lambda: publisher.qos_profile, message)

    @classmethod
    def _on_loopback(cls, subscription: 'LoopbackSubscription[Any]', message: Any) -> None:
        topic = subscription.topic
        # Several nodes may take the same topic; one of them tells.
        if cls._first.setdefault(topic, subscription) is subscription:
            cls._tell(topic, type_name(type(message)), lambda: subscription.qos_profile, message)

    @classmethod
    def _tell(cls, topic: str, kind: str, profile: Callable[[], Any], message: Any) -> None:
        wanting = [tap for tap in cls._taps if tap._wants(topic)] if topic != IGNORED else []
        if not wanting:
            return
        data = message if isinstance(message, bytes) else to_bytes(message)
        for tap in wanting:
            tap._hear(topic, kind, profile(), data)


# In front of a message's fields.
CDR_HEADER = 4


def to_bytes(message: Any) -> bytes:
    """Return a message as CDR; the middleware reserves more than that behind empty sequences."""
    return serialize_message(message)[: CDR_HEADER + cdr_end(message)]


# The file on disk is at most so much older than the run [s of wall time].
SAVE_PERIOD = 0.5
# What happens to a run from outside and is no message: 'reset', 'step', 'e-stop', 'program'.
EVENTS = '/wasd/events'


class BagRecorder:
    """
    Writes what is published in this process from its construction to `close`.

    `now` returns simulated time [ns]; set it once there is a simulation. The first failure to
    write raises OutputError where the message was published; from then on nothing is recorded.
    """

    def __init__(self, path: Path | OutputFile, run: Mapping[str, str]) -> None:
        """
        Begin a recording; `run` says what was asked for. The file is replaced by the first save.

        Raises:
            OutputError: the file cannot be written.
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
            OutputError: the disk is full, or the like.
        """
        now = time.monotonic()
        if self._writer is not None and now - self._saved_at >= SAVE_PERIOD:
            self._saved_at = now
            self._guarded(self._writer.save)

    def close(self) -> None:
        """
        Finish the file.

        Raises:
            OutputError: the disk is full, or the like.
        """
        self._tap.remove()
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.close()

    def discard(self) -> None:
        """Record no more, and leave the file as last saved: nothing has run, or a write failed."""
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
        except OutputError:
            self.discard()  # once is enough: stopping the robot publishes, too
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
