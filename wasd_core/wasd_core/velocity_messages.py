# SPDX-License-Identifier: Apache-2.0
"""Velocities as Twist and TwistStamped, and back."""

from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist, TwistStamped
from std_msgs.msg import Header

VELOCITY_TYPES: dict[str, type[Any]] = {
    'geometry_msgs/msg/Twist': Twist,
    'geometry_msgs/msg/TwistStamped': TwistStamped,
}


def to_twist(vx: float, vy: float, vz: float, wz: float) -> Twist:
    """Return a velocity [m/s], [rad/s] as a message; rolling and pitching are zero."""
    message = Twist()
    # As they come back: an echo is known by its text.
    message.linear.x, message.linear.y, message.linear.z = float(vx), float(vy), float(vz)
    message.angular.z = float(wz)
    return message


def stamped(twist: Twist, stamp: Time | None, frame: str) -> Twist | TwistStamped:
    """Return a twist as TwistStamped; without a stamp as it is."""
    if stamp is None:
        return twist
    return TwistStamped(header=Header(stamp=stamp, frame_id=frame), twist=twist)


def twist_of(message: Twist | TwistStamped) -> Twist:
    """Return the twist of a message of either type."""
    return message.twist if isinstance(message, TwistStamped) else message


def to_velocity(message: Twist | TwistStamped) -> tuple[float, float, float]:
    """Return vx, vy [m/s], wz [rad/s] of a message."""
    twist = twist_of(message)
    return twist.linear.x, twist.linear.y, twist.angular.z
