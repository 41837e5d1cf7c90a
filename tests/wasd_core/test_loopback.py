# SPDX-License-Identifier: Apache-2.0
import math
import time

from geometry_msgs.msg import Twist
import numpy as np
import pytest
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from wasd_core.topics import EVENTS, LoopbackSubscription
from wasd_core.velocity_messages import to_twist

from wasd_core import topics as topics_module

pytestmark = pytest.mark.slow


def twist(speed):
    message = Twist()
    message.linear.x = speed
    return message


class Receiver(Node):
    """A node that publishes for everybody, and takes the same messages itself."""

    def __init__(self):
        super().__init__('receiver')
        self.received = []
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 100)
        self.subscription = LoopbackSubscription(
            self, Twist, 'cmd_vel', lambda m: self.received.append(m.linear.x), EVENTS
        )

    def take(self, speed):
        """Act as if it published a speed, which it takes itself at once."""
        self.subscription.expect(twist(speed))
        self.received.append(speed)

    def send(self, speed):
        self.take(speed)
        self.publisher.publish(twist(speed))


@pytest.fixture
def receiver(spawn):
    return spawn(Receiver())


@pytest.fixture
def outside(spawn, receiver, spin_until):
    """Return a publisher that is not the receiver's own; the two have found each other."""
    node = spawn(Node('outside'))
    publisher = node.create_publisher(Twist, 'cmd_vel', 100)
    spin_until(spawn.pump, lambda: publisher.get_subscription_count() > 0)
    return publisher


@pytest.fixture
def end_with_nine(spawn, spin_until):
    """Return what publishes 9.0 from outside, and waits until all that was sent has come."""

    def end(receiver, outside):
        outside.publish(twist(9.0))
        spin_until(spawn.pump, lambda: 9.0 in receiver.received)
        for _ in range(5):
            spawn.pump.handle(0.02)

    return end


def test_a_message_from_outside_is_delivered(receiver, outside, spawn, spin_until):
    outside.publish(twist(0.7))
    spin_until(spawn.pump, lambda: receiver.received == [0.7])


def test_witnesses_are_told_of_what_came_from_outside_only(
    receiver, outside, spawn, spin_until, monkeypatch
):
    told = []
    observer = lambda taken, message: told.append((taken.topic, message.linear.x))  # noqa: E731
    monkeypatch.setattr(LoopbackSubscription, 'observers', [observer])
    receiver.send(0.4)
    outside.publish(twist(0.7))
    spin_until(spawn.pump, lambda: receiver.received == [0.4, 0.7])
    assert told == [('/cmd_vel', 0.7)]


def test_the_echo_of_what_is_expected_is_dropped(receiver, outside, spawn, spin_until):
    receiver.subscription.expect(twist(0.2))
    receiver.publisher.publish(twist(0.2))
    outside.publish(twist(9.0))
    spin_until(spawn.pump, lambda: 9.0 in receiver.received)
    assert receiver.received == [9.0]


def test_the_echo_of_a_message_of_its_own_is_dropped(receiver, outside, end_with_nine):
    for index in range(20):
        receiver.send(0.1 * index)
    end_with_nine(receiver, outside)
    assert sorted(receiver.received) == pytest.approx([0.1 * index for index in range(20)] + [9.0])


def test_equal_messages_sent_twice_are_two(receiver, outside, end_with_nine):
    receiver.send(0.5)
    receiver.send(0.5)
    end_with_nine(receiver, outside)
    assert sorted(receiver.received) == [0.5, 0.5, 9.0]


def test_after_the_echo_an_equal_message_from_outside_counts(receiver, outside, spawn, spin_until):
    receiver.send(0.5)
    spin_until(spawn.pump, lambda: not receiver.subscription._pending)
    assert receiver.received == [0.5]
    outside.publish(twist(0.5))
    spin_until(spawn.pump, lambda: receiver.received == [0.5, 0.5])


@pytest.mark.parametrize('bad', [math.nan, math.inf])
def test_the_echo_of_what_is_no_number_is_dropped(receiver, outside, end_with_nine, bad):
    # NaN is not equal to itself: compared by value, its echo would come through.
    receiver.send(bad)
    end_with_nine(receiver, outside)
    assert len(receiver.received) == 2


@pytest.fixture
def impatient(monkeypatch, spawn):
    """Return a receiver that waits for echoes for 0.1 s only."""
    monkeypatch.setattr(topics_module, 'ECHO_LIFETIME', 0.1)
    return spawn(Receiver())


def test_an_echo_that_never_came_is_not_waited_for(impatient, spawn, spin_until):
    impatient.take(0.5)  # not published, so no echo
    started = time.monotonic()
    spin_until(spawn.pump, lambda: not impatient.subscription._pending)
    assert time.monotonic() - started >= 0.07
    impatient.publisher.publish(twist(0.5))  # as good as from outside
    spin_until(spawn.pump, lambda: impatient.received == [0.5, 0.5])


def test_echoes_that_wait_for_a_busy_process_are_dropped(impatient, spawn, spin_until):
    for _ in range(3):
        impatient.send(0.5)
        time.sleep(0.15)  # nobody spins meanwhile
    spin_until(spawn.pump, lambda: not impatient.subscription._pending)
    for _ in range(5):
        spawn.pump.handle(0.02)
    assert impatient.received == [0.5, 0.5, 0.5]


def test_an_echo_that_is_handled_after_the_look_for_overdue_ones_is_dropped(
    impatient, spawn, spin_until
):
    spin_until(spawn.pump, lambda: impatient.publisher.get_subscription_count() == 1)
    impatient.send(0.5)
    impatient.subscription._forget()
    time.sleep(0.15)  # now the echo is overdue, and the timer of the next look comes before it
    spin_until(spawn.pump, lambda: not impatient.subscription._pending)
    for _ in range(5):
        spawn.pump.handle(0.02)
    assert impatient.received == [0.5]


def test_a_lost_echo_does_not_hold_up_the_next(receiver, outside, end_with_nine):
    receiver.take(0.1)  # lost: only the next one comes back
    receiver.send(0.2)
    end_with_nine(receiver, outside)
    assert receiver.received == [0.1, 0.2, 9.0]


def test_an_equal_message_from_outside_that_comes_first_has_no_own_one_come_back(
    receiver, outside, end_with_nine
):
    outside.publish(twist(0.2))
    time.sleep(0.2)  # it waits before what comes now
    receiver.send(0.1)
    receiver.send(0.2)
    end_with_nine(receiver, outside)
    assert sorted(receiver.received) == [0.1, 0.2, 0.2, 9.0]


def test_echoes_that_are_lost_are_not_waited_for_longer(impatient, spawn, spin_until):
    for speed in range(100):
        impatient.take(0.1 * speed)  # lost
    impatient.send(-0.5)
    spin_until(spawn.pump, lambda: not impatient.subscription._pending)


def test_a_velocity_of_any_numbers_has_the_text_of_its_echo():
    message = to_twist(1, np.float64(0.3), np.float32(0.3), True)
    assert repr(deserialize_message(serialize_message(message), Twist)) == repr(message)
