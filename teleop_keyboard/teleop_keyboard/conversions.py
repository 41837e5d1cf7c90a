# SPDX-License-Identifier: Apache-2.0
"""Velocities to ROS messages and back."""

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist
from geometry_msgs.msg import TwistStamped

from teleop_keyboard.ramp import Twist3


def to_twist(velocity: Twist3) -> Twist:
    """Return the message of a velocity; the components that a plane lacks are zero."""
    message = Twist()
    message.linear.x = velocity.vx
    message.linear.y = velocity.vy
    message.angular.z = velocity.wz
    return message


def to_twist_stamped(velocity: Twist3, stamp: Time, frame_id: str) -> TwistStamped:
    """Return the stamped message of a velocity seen in `frame_id`."""
    message = TwistStamped(twist=to_twist(velocity))
    message.header.stamp = stamp
    message.header.frame_id = frame_id
    return message


def from_twist(message: Twist | TwistStamped) -> Twist3:
    """Return the planar part of a message."""
    twist = message.twist if isinstance(message, TwistStamped) else message
    return Twist3(twist.linear.x, twist.linear.y, twist.angular.z)
