# SPDX-License-Identifier: Apache-2.0
"""The topic cmd_vel, as Twist and TwistStamped at the same time."""

from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import Twist
from geometry_msgs.msg import TwistStamped
import rclpy
from rclpy.clock import Clock
from rclpy.clock import ClockType
from rclpy.context import Context
from rclpy.node import Node
from wasd_core.topics import LoopbackSubscription
from wasd_core.topics import RELIABLE

TYPES = {'geometry_msgs/msg/Twist': Twist, 'geometry_msgs/msg/TwistStamped': TwistStamped}
# How often publishers of the other type are looked for, and their messages taken [s, wall time].
LOOK_PERIOD = 0.5
TAKE_PERIOD = 0.005


class VelocityInput:
    """
    Hands on what arrives on cmd_vel: `on_twist` and `on_stamped` are called with the messages.

    A DDS participant knows one type per topic. With `stamped` `auto` this one listens for Twist;
    once somebody publishes TwistStamped, a second participant listens for that. `put` hands over
    a message of this process, and `is_stale` judges those of others, as a LoopbackSubscription's.
    """

    def __init__(
        self,
        node: Node,
        stamped: str,
        on_twist: Callable[[Twist], None],
        on_stamped: Callable[[TwistStamped], None],
        is_stale: Callable[[int], bool] = lambda sent: False,
    ) -> None:
        self._node = node
        self._is_stale = is_stale
        self._handlers: dict[type, Callable[[Any], None]] = {
            Twist: on_twist,
            TwistStamped: on_stamped,
        }
        self._type = TwistStamped if stamped == 'true' else Twist
        self._subscription: LoopbackSubscription[Any] = LoopbackSubscription(
            node, self._type, 'cmd_vel', self._handlers[self._type], RELIABLE, is_stale
        )
        self._topic = node.resolve_topic_name('cmd_vel')
        self._other: _OtherParticipant | None = None
        if stamped == 'auto':
            self._wall = Clock(clock_type=ClockType.STEADY_TIME)
            self._timer = node.create_timer(LOOK_PERIOD, self._look, clock=self._wall)

    def put(self, message: Any) -> None:
        """Hand over a message that this process publishes, too."""
        if isinstance(message, self._type):
            self._subscription.put(message)
        else:
            self._handlers[type(message)](message)

    def close(self) -> None:
        """Leave the second participant."""
        if self._other is not None:
            self._other.close()

    def _look(self) -> None:
        """Listen for the other type as soon as somebody publishes it."""
        for info in self._node.get_publishers_info_by_topic(self._topic):
            kind = TYPES.get(info.topic_type, self._type)
            if kind is not self._type:
                self._other = _OtherParticipant(self._node, kind, self._topic)
                self._node.destroy_timer(self._timer)
                self._timer = self._node.create_timer(TAKE_PERIOD, self._take, clock=self._wall)
                return

    def _take(self) -> None:
        assert self._other is not None
        for message, sent in self._other.take():
            if not self._is_stale(sent):
                self._subscription.notify(message)
                self._handlers[type(message)](message)


class _OtherParticipant:
    """A subscription in a context of its own, asked for its messages."""

    def __init__(self, node: Node, message_type: type, topic: str) -> None:
        self._type = message_type
        self._context = Context()
        self._context.init(args=[], domain_id=node.context.get_domain_id())
        self._node = rclpy.create_node(
            f'{node.get_name()}_stamped_input',
            namespace=node.get_namespace(),
            context=self._context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._subscription = self._node.create_subscription(
            message_type, topic, lambda message: None, RELIABLE
        )

    def take(self) -> list[tuple[Any, int]]:
        """Return the messages that have arrived, and when they were sent [ns of system time]."""
        found = []
        while (taken := self._subscription.handle.take_message(self._type, False)) is not None:
            found.append((taken[0], taken[1]['source_timestamp']))
        return found

    def close(self) -> None:
        self._node.destroy_node()
        self._context.try_shutdown()
