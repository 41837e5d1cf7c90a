# SPDX-License-Identifier: Apache-2.0
"""Hears every message of this process when it is published, and what comes from others."""

from collections.abc import Callable
import importlib
from typing import Any

from rclpy.publisher import Publisher
from rclpy.serialization import serialize_message
from wasd_core.topics import LoopbackSubscription

from wasd_bringup.cdr_padding import clear_padding

# Given the topic, its type, its quality of service and the message as CDR.
Hear = Callable[[str, str, Any, bytes], None]
# Bears stamps of the wall clock and tells of nodes, not of robots.
IGNORED = '/parameter_events'


class PublisherTap:
    """
    Stands between all publishers of this process and the middleware until `remove`.

    A subscription would hear messages later, in an order of its own, and lose some at full speed;
    here they come in the order and at the simulated instant of their publishing. It counts as a
    listener: what is made only for listeners is made. A message that another process sent to one
    of our subscriptions is heard once, when the subscription takes it.
    """

    def __init__(self, hear: Hear) -> None:
        self._hear = hear
        self._topics: dict[Publisher, tuple[str, str]] = {}
        self._first: dict[str, LoopbackSubscription[Any]] = {}
        publishers: Any = Publisher
        self._publish = publishers.publish
        self._count = publishers.get_subscription_count
        # rclpy has no hook for this; its publishers are plain Python.
        publishers.publish = lambda publisher, message: self._on_publish(publisher, message)
        publishers.get_subscription_count = lambda publisher: self._count(publisher) + 1
        LoopbackSubscription.observers.append(self._on_loopback)

    def remove(self) -> None:
        """Let messages pass unheard again."""
        publishers: Any = Publisher
        publishers.publish = self._publish
        publishers.get_subscription_count = self._count
        LoopbackSubscription.observers.remove(self._on_loopback)

    def _on_publish(self, publisher: Any, message: Any) -> None:
        self._publish(publisher, message)
        if publisher not in self._topics:
            self._topics[publisher] = publisher.topic_name, type_name(publisher.msg_type)
        topic, kind = self._topics[publisher]
        if topic != IGNORED:
            if not isinstance(message, bytes):
                message = to_bytes(message)
            self._hear(topic, kind, publisher.qos_profile, message)

    def _on_loopback(self, subscription: 'LoopbackSubscription[Any]', message: Any) -> None:
        topic = subscription.topic
        # Several nodes may take the same topic; one of them tells.
        if self._first.setdefault(topic, subscription) is subscription:
            self._hear(
                topic, type_name(type(message)), subscription.qos_profile, to_bytes(message)
            )


def to_bytes(message: Any) -> bytes:
    """Return a message as CDR; equal messages are equal bytes."""
    return clear_padding(serialize_message(message), type(message), _find_message)


def _find_message(name: str) -> Any:
    package, _, last = name.partition('/')
    return getattr(importlib.import_module(f'{package}.msg'), last)


def type_name(kind: type[Any]) -> str:
    """Return `package/msg/Name` of a message class."""
    package, interface, *_ = kind.__module__.split('.')
    return f'{package}/{interface}/{kind.__name__}'
