# SPDX-License-Identifier: Apache-2.0
"""Velocities to ROS messages and back."""

import math

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from geometry_msgs.msg import Twist
from geometry_msgs.msg import TwistStamped
from visualization_msgs.msg import Marker

from teleop_keyboard.ramp import Velocity

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
