# SPDX-License-Identifier: Apache-2.0
"""States of a gamepad and their velocities as messages, and back."""

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist
from sensor_msgs.msg import Joy

from teleop_keyboard.gamepad import JoyState
from teleop_keyboard.joy_to_twist import JoyTwist

# As the `joy` drivers call it.
FRAME = 'joy'


def to_joy(state: JoyState, stamp: Time) -> Joy:
    """Return the message of a state."""
    message = Joy(axes=state.axes, buttons=state.buttons)
    message.header.stamp = stamp
    message.header.frame_id = FRAME
    return message


def from_joy(message: Joy) -> JoyState:
    """Return the state of a message."""
    return JoyState(tuple(message.axes), tuple(message.buttons))


def to_full_twist(velocity: JoyTwist) -> Twist:
    """Return the message of a velocity with all its six components."""
    message = Twist()
    message.linear.x, message.linear.y, message.linear.z = velocity[:3]
    message.angular.x, message.angular.y, message.angular.z = velocity[3:]
    return message
