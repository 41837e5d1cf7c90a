# SPDX-License-Identifier: Apache-2.0
"""The commands of a recording: keys, velocities, and what happened to the run from outside."""

import json
from typing import Any

from geometry_msgs.msg import Twist
from geometry_msgs.msg import TwistStamped
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from wasd_bringup.bag_reader import BagReader
from wasd_bringup.bag_recorder import EVENTS
from wasd_bringup.scripts import Command

KEYS = 'keys'
VELOCITIES = 'cmd_vel'
DESCRIPTION = 'robot_description'
TRUTH = 'ground_truth/odom'
TWISTS: dict[str, Any] = {
    'geometry_msgs/msg/Twist': Twist,
    'geometry_msgs/msg/TwistStamped': TwistStamped,
}


def robot_topics(bag: BagReader, name: str) -> dict[str, str]:
    """
    Return the full names of a topic of every robot, by the robot's name.

    A robot alone has none, whichever namespace ROS arguments gave it.
    """
    found = {}
    is_alone = json.loads(bag.run['robot']) != 'both'
    for topic in bag.topics:
        namespace, _, last = topic.name[1:].rpartition(name)
        if topic.name.endswith(f'/{name}') and not last and '/' not in namespace.rstrip('/'):
            found['' if is_alone else namespace.rstrip('/')] = topic.name
    return found


def read_commands(bag: BagReader) -> tuple[Command, ...]:
    """
    Return everything that commanded the robots, in the order in which it came.

    Raises:
        RecordingError: the file is damaged.
    """
    keys = {topic: namespace for namespace, topic in robot_topics(bag, KEYS).items()}
    velocities = {topic: namespace for namespace, topic in robot_topics(bag, VELOCITIES).items()}
    kinds = {topic.name: topic.kind for topic in bag.topics}
    commands = []
    for message in bag.messages([*keys, *velocities, EVENTS]):
        time = 1e-9 * message.time
        if message.topic in velocities:
            twist = deserialize_message(message.data, TWISTS[kinds[message.topic]])
            twist = getattr(twist, 'twist', twist)
            velocity = twist.linear.x, twist.linear.y, twist.angular.z
            commands.append(Command(time, velocities[message.topic], velocity=velocity))
        else:
            text = deserialize_message(message.data, String).data
            if message.topic in keys:
                commands.append(Command(time, keys[message.topic], key=text))
            else:
                commands.append(Command(time, ''))
    return tuple(commands)
