# SPDX-License-Identifier: Apache-2.0
"""What is published in this process is heard in its order; what others send is heard once."""

from collections.abc import Iterator
from typing import Any

import pytest
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from std_msgs.msg import String
from wasd_bringup.tools.recording.recorder import PublisherTap
from wasd_core.topics import has_listener, LoopbackSubscription

pytestmark = pytest.mark.slow


@pytest.fixture
def heard() -> Iterator[list[tuple[str, str, str]]]:
    """Tap this process; yield topic, type and text of all that is heard."""
    found: list[tuple[str, str, str]] = []

    def hear(topic: str, kind: str, profile: Any, data: bytes) -> None:
        found.append((topic, kind, deserialize_message(data, String).data))

    tap = PublisherTap(hear)
    yield found
    tap.remove()


def test_messages_are_heard_in_the_order_of_publishing(heard: Any, spawn: Any) -> None:
    node = spawn(Node('talker', namespace='go2'))
    first, second = (node.create_publisher(String, name, 1) for name in ('a', '/b'))
    for index in range(200):  # more than any queue holds
        (second if index % 3 else first).publish(String(data=str(index)))
    assert [text for _, _, text in heard] == [str(index) for index in range(200)]
    assert heard[:2] == [('/go2/a', 'std_msgs/msg/String', '0'), ('/b', heard[0][1], '1')]


def test_it_counts_as_a_listener_until_it_is_removed(spawn: Any) -> None:
    publisher = spawn(Node('talker')).create_publisher(String, 'a', 1)
    assert not has_listener(publisher)
    tap = PublisherTap(lambda *_: None)
    assert has_listener(publisher)
    tap.remove()
    assert not has_listener(publisher)


def test_what_two_subscriptions_take_from_outside_is_heard_once(heard: Any, spawn: Any) -> None:
    node = spawn(Node('robot'))
    subscriptions = [LoopbackSubscription(node, String, 'keys', lambda _: None) for _ in range(2)]
    for subscription in subscriptions:
        subscription.hear(String(data='w'))
    assert heard == [('/keys', 'std_msgs/msg/String', 'w')]
