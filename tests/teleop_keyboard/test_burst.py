# SPDX-License-Identifier: Apache-2.0
"""A burst of keys arrives whole and in order."""

import random
import time

import pytest
from rclpy.node import Node
from std_msgs.msg import String
from teleop_keyboard.key_publisher_node import KeyPublisherNode
from wasd_core.topics import EVENTS, LoopbackSubscription

pytestmark = pytest.mark.slow

BURST = 2000


def keys_of(count):
    rng = random.Random(3)
    return [rng.choice('uiojklm,.qzwxec') for _ in range(count)]


def test_a_burst_reaches_a_subscriber_that_is_busy_meanwhile(spawn, spin_until):
    publisher = spawn(KeyPublisherNode())
    heard = []
    robot = spawn(Node('robot'))
    robot.create_subscription(String, 'keys', lambda m: heard.append(m.data), EVENTS)
    spin_until(spawn.pump, lambda: publisher.has_subscriber)
    typed = keys_of(BURST)
    for key in typed:
        publisher.publish_key(key)
    time.sleep(0.5)
    spin_until(spawn.pump, lambda: len(heard) >= BURST)
    assert heard == typed


def test_a_burst_that_is_handed_over_is_not_heard_twice(spawn, spin_until):
    publisher = spawn(KeyPublisherNode())
    heard = []
    robot = spawn(Node('robot'))
    subscription = LoopbackSubscription(
        robot, String, 'keys', lambda m: heard.append(m.data), EVENTS
    )
    publisher.receivers += [subscription.expect, subscription.hear]
    spin_until(spawn.pump, lambda: publisher.has_subscriber)
    typed = keys_of(BURST)
    for key in typed:
        publisher.publish_key(key)
    assert heard == typed
    spin_until(spawn.pump, lambda: not subscription._pending)
    assert heard == typed
