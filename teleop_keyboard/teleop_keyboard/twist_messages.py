# SPDX-License-Identifier: Apache-2.0
"""Velocities as messages: Twist or TwistStamped, whichever the subscriber of a topic takes."""

from collections.abc import Callable
import math
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Twist, TwistStamped
from rcl_interfaces.msg import ParameterDescriptor
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from visualization_msgs.msg import Marker
from wasd_core.parameters import InvalidParameter
from wasd_core.topics import RELIABLE

from teleop_keyboard.keys_to_twist import Velocity

# The marker floats so high above the robot, as twist_mux's, and is so thick [m].
MARKER_HEIGHT = 2.0
MARKER_WIDTH = 0.1


def to_twist(velocity: Velocity) -> Twist:
    """Return the message of a velocity; rolling and pitching are zero."""
    message = Twist()
    message.linear.x = velocity.vx
    message.linear.y = velocity.vy
    message.linear.z = velocity.vz
    message.angular.z = velocity.wz
    return message


def from_twist(message: Twist | TwistStamped) -> Velocity:
    """Return the velocity of a message, without rolling and pitching."""
    twist = message.twist if isinstance(message, TwistStamped) else message
    return Velocity(twist.linear.x, twist.linear.y, twist.linear.z, twist.angular.z)


def is_finite(twist: Twist) -> bool:
    """Whether no component is NaN or infinite."""
    vectors = (twist.linear, twist.angular)
    return all(math.isfinite(value) for v in vectors for value in (v.x, v.y, v.z))


def to_marker(twist: Twist, stamp: Time, frame_id: str) -> Marker:
    """Return an arrow above the robot: where it is in a second, turned the way it turns."""
    marker = Marker(ns='twist', id=0, type=Marker.ARROW, action=Marker.ADD)
    marker.header.stamp = stamp
    marker.header.frame_id = frame_id
    speed = math.hypot(twist.linear.x, twist.linear.y)
    heading = math.atan2(twist.linear.y, twist.linear.x) if speed > 0.0 else 0.0
    # Half of the turn of a second: the chord of the arc that the robot drives.
    heading += 0.5 * twist.angular.z
    length = max(speed, abs(twist.angular.z) * MARKER_WIDTH)
    marker.points = [
        Point(x=0.0, y=0.0, z=MARKER_HEIGHT),
        Point(
            x=length * math.cos(heading),
            y=length * math.sin(heading),
            z=MARKER_HEIGHT + twist.linear.z,
        ),
    ]
    # Diameters of the shaft and of the head.
    marker.scale.x = MARKER_WIDTH
    marker.scale.y = 2.0 * MARKER_WIDTH
    marker.pose.orientation.w = 1.0
    marker.color.g = marker.color.a = 1.0
    return marker


# How often the subscribers' types are looked at [s of wall time].
LOOK_PERIOD = 0.25
TYPES = {'geometry_msgs/msg/Twist': Twist, 'geometry_msgs/msg/TwistStamped': TwistStamped}
STAMPED_CHOICES = ('auto', 'true', 'false')


def declare_stamped(node: Node) -> str:
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
    value = node.declare_parameter('stamped', 'auto', descriptor).value
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
    Publishes velocities on a topic of a node, after `receivers` are called with each message.

    With `stamped` `auto` the type is that of the subscribers as far as they agree, Twist before
    there is one. One warning names the nodes that have the topic under the other type. A process
    can have a topic under one type only: what it has stays. Where `follow` is off nothing is
    looked at: a node that somebody else steps makes no timers, and keeps to Twist.

    Raises:
        InvalidParameter: this process has the topic under the type that `stamped` rules out.
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
        self._follows = stamped == 'auto'
        self._frame_id = frame_id
        self._has_warned = False
        self.type: type = TwistStamped if stamped == 'true' else Twist
        self._publisher = self._make_publisher()
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
        """Compare our type with that of the others on the topic: follow it, or warn once."""
        subscribers = self._node.get_subscriptions_info_by_topic(self._topic)
        wanted = type_of(subscribers)
        if self._follows and wanted not in (None, self.type):
            self._node.destroy_publisher(self._publisher)
            self.type = wanted
            self._publisher = self._make_publisher()
        if self._has_warned:
            return
        others = [*subscribers, *self._node.get_publishers_info_by_topic(self._topic)]
        strange = [info for info in others if TYPES.get(info.topic_type, self.type) != self.type]
        if strange:
            self._has_warned = True
            names = ', '.join(sorted({info.node_name for info in strange}))
            self._node.get_logger().warning(
                f'{self._topic}: {names} has {TYPES[strange[0].topic_type].__name__}, this sends '
                f'{self.type.__name__}: see the parameter stamped'
            )

    def _make_publisher(self) -> Any:
        """Return a publisher of our type, or of the one under which this process has the topic."""
        try:
            return self._node.create_publisher(self.type, self._topic, RELIABLE)
        except RCLError:
            (other,) = {Twist, TwistStamped} - {self.type}
            if not self._follows:
                raise InvalidParameter(
                    f'{self._topic} is {other.__name__} in this process, got stamped for '
                    f'{self.type.__name__}'
                ) from None
        # From now on it stays: trying again and again would lose messages.
        self._follows = False
        self.type = other
        return self._node.create_publisher(self.type, self._topic, RELIABLE)
