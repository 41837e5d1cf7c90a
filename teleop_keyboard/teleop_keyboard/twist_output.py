# SPDX-License-Identifier: Apache-2.0
"""Velocities to one topic, as Twist or TwistStamped, whichever its subscriber takes."""

from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import Twist
from geometry_msgs.msg import TwistStamped
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.clock import Clock
from rclpy.clock import ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from robot_description.parameters import InvalidParameter
from robot_description.qos import RELIABLE

# How often the subscribers' types are looked at [s of wall time].
LOOK_PERIOD = 0.25
TYPES = {'geometry_msgs/msg/Twist': Twist, 'geometry_msgs/msg/TwistStamped': TwistStamped}
STAMPED_CHOICES = ('auto', 'true', 'false')


def declare_stamped(node: Node, default: str = 'auto') -> str:
    """
    Declare the parameter `stamped` of a node; return auto, true or false.

    A boolean is accepted: that is what `-p stamped:=true` sends.

    Raises:
        InvalidParameter: it is something else.
    """
    descriptor = ParameterDescriptor(
        description='Publish TwistStamped; auto: what the subscriber takes.',
        additional_constraints=', '.join(STAMPED_CHOICES),
        read_only=True,
        dynamic_typing=True,
    )
    value = node.declare_parameter('stamped', default, descriptor).value
    text = str(value).lower()
    if text not in STAMPED_CHOICES:
        wanted = ', '.join(STAMPED_CHOICES)
        raise InvalidParameter(f'stamped must be one of {wanted}, got {value!r}')
    return text


def type_of(infos: list[Any]) -> type | None:
    """Return the one type of velocity of all endpoints; None when there is none, or two."""
    types = {TYPES[info.topic_type] for info in infos if info.topic_type in TYPES}
    return types.pop() if len(types) == 1 else None


class TwistOutput:
    """
    Publishes velocities on a topic of a node.

    With `stamped` `auto` the type is that of the subscribers as far as they agree, Twist before
    there is one. Subscribers of the other type are warned of, once. Where `follow` is off nothing
    is looked at: a node in lock-step makes no timers, and keeps to Twist.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        stamped: str,
        frame_id: Callable[[], str],
        follow: bool = True,
    ) -> None:
        self._node = node
        self._topic = node.resolve_topic_name(topic)
        self._stamped = stamped
        self._frame_id = frame_id
        self._has_warned = False
        self.type: type = TwistStamped if stamped == 'true' else Twist
        self._publisher = node.create_publisher(self.type, topic, RELIABLE)
        self.receivers: list[Callable[[Any], None]] = []
        if follow:
            # Wall time: simulated time may stand still while somebody subscribes.
            clock = Clock(clock_type=ClockType.STEADY_TIME)
            self._timer = node.create_timer(LOOK_PERIOD, self.look, clock=clock)

    @property
    def subscriber_count(self) -> int:
        """Number of subscribers that get what is published."""
        count: int = self._publisher.get_subscription_count()
        return count

    def publish(self, twist: Twist) -> None:
        """Publish a velocity; a stamp is the node's time."""
        message: Any = twist
        if self.type is TwistStamped:
            message = TwistStamped(twist=twist)
            message.header.stamp = self._node.get_clock().now().to_msg()
            message.header.frame_id = self._frame_id()
        for receiver in self.receivers:
            receiver(message)
        self._publisher.publish(message)

    def wait_for_all_acked(self, seconds: float) -> None:
        """Give the last messages the time to leave the process."""
        self._publisher.wait_for_all_acked(Duration(seconds=seconds))

    def look(self) -> None:
        """Compare our type with that of the subscribers: follow it, or warn once."""
        infos = self._node.get_subscriptions_info_by_topic(self._topic)
        wanted = type_of(infos)
        if self._stamped == 'auto' and wanted not in (None, self.type):
            self._change_type(wanted)
        known = [info for info in infos if info.topic_type in TYPES]
        deaf = [info for info in known if TYPES[info.topic_type] is not self.type]
        if deaf and not self._has_warned:
            self._has_warned = True
            names = ', '.join(sorted({info.node_name for info in deaf}))
            self._node.get_logger().warning(
                f'{self._topic}: {names} wants {TYPES[deaf[0].topic_type].__name__}, this sends '
                f'{self.type.__name__}: see the parameter stamped'
            )

    def _change_type(self, wanted: type) -> None:
        self._node.destroy_publisher(self._publisher)
        self._publisher = self._node.create_publisher(wanted, self._topic, RELIABLE)
        self.type = wanted
