# SPDX-License-Identifier: Apache-2.0
"""What Foxglove's clients publish, as CDR or JSON, read as a velocity or a key."""

from collections.abc import Sequence
import json
from typing import Any

from geometry_msgs.msg import Twist
from geometry_msgs.msg import TwistStamped
from rclpy.serialization import deserialize_message
from std_msgs.msg import String
from wasd_core.errors import one_line
from wasd_core.errors import UserError

from wasd_bringup.foxglove_inbox import Decode
from wasd_bringup.foxglove_inbox import Sender
from wasd_bringup.foxglove_inbox import Velocity
from wasd_bringup.graph.ros_graph import find_type
from wasd_bringup.messages import fill
from wasd_bringup.messages import type_name

# CDR begins with its representation, of which ROS has these: big and little endian.
REPRESENTATIONS = (b'\0\0', b'\0\1')
HEADER = 4


def read_velocity(sender: Sender, data: bytes) -> Velocity:
    """
    Return the velocity of a Twist or TwistStamped [m/s], [m/s], [rad/s].

    Raises:
        UserError: it is no such message.
    """
    message = _read(sender, data, (Twist, TwistStamped))
    twist = message.twist if isinstance(message, TwistStamped) else message
    return twist.linear.x, twist.linear.y, twist.angular.z


def read_key(sender: Sender, data: bytes) -> str:
    """
    Return the key of a String.

    Raises:
        UserError: it is no such message.
    """
    text: str = _read(sender, data, (String,)).data
    return text


DECODE = Decode(read_velocity, read_key)


def _read(sender: Sender, data: bytes, kinds: Sequence[type[Any]]) -> Any:
    """Return a message of one of the kinds, the one that its schema names."""
    names = {type_name(kind).replace('/msg/', '/'): kind for kind in kinds}
    kind = names.get(sender.schema.replace('/msg/', '/'))
    if kind is None:
        wanted = ' or '.join(names)
        raise UserError(f'{sender.topic}: got {sender.schema or "no schema"}, wanted {wanted}')
    try:
        if sender.encoding == 'cdr':
            if data[:2] not in REPRESENTATIONS or len(data) <= HEADER:
                raise ValueError('no CDR')
            return deserialize_message(data, kind)
        if sender.encoding == 'json':
            message = kind()
            fill(message, json.loads(data), lambda name: find_type(name, 'msg'))
            return message
    except (ArithmeticError, AssertionError, RuntimeError, RecursionError, ValueError) as error:
        raise UserError(f'{sender.topic}: {one_line(error)}') from None
    raise UserError(f'{sender.topic}: got {sender.encoding}, wanted cdr or json')
