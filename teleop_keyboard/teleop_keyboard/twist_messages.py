# SPDX-License-Identifier: Apache-2.0
"""Velocities as messages, Twist or TwistStamped, and their publisher."""

from collections.abc import Callable
import math
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Twist, TwistStamped
from rclpy.duration import Duration
from rclpy.node import Node
from visualization_msgs.msg import Marker
from wasd_core.topics import RELIABLE
from wasd_core.velocity_messages import stamped, twist_of

from teleop_keyboard.keys_to_twist import Velocity

# The zero that ends it all may take this long to leave [s].
LAST_WORDS_TIMEOUT = 0.25
# The marker floats so high above the robot, as twist_mux's, and is so thick [m].
MARKER_HEIGHT = 2.0
MARKER_WIDTH = 0.1


def from_twist(message: Twist | TwistStamped) -> Velocity:
    """Return the velocity of a message, without rolling and pitching."""
    twist = twist_of(message)
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


class TwistOutput:
    """Publishes velocities on a topic, after `receivers` are called with each message."""

    def __init__(
        self, node: Node, topic: str, is_stamped: bool, frame_id: Callable[[], str]
    ) -> None:
        self._node = node
        self._frame_id = frame_id
        self.type: type = TwistStamped if is_stamped else Twist
        self._publisher: Any = node.create_publisher(self.type, topic, RELIABLE)
        self.receivers: list[Callable[[Any], None]] = []

    @property
    def subscriber_count(self) -> int:
        """Number of subscribers that get what is published."""
        count: int = self._publisher.get_subscription_count()
        return count

    def publish(self, twist: Twist) -> None:
        """Publish a velocity; a stamp is the node's time."""
        now = self._node.get_clock().now().to_msg() if self.type is TwistStamped else None
        message = stamped(twist, now, self._frame_id())
        for receiver in self.receivers:
            receiver(message)
        self._publisher.publish(message)

    def see_off(self) -> None:
        """Give the last messages the time to leave the process."""
        self._publisher.wait_for_all_acked(Duration(seconds=LAST_WORDS_TIMEOUT))
