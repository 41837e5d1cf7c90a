# SPDX-License-Identifier: Apache-2.0
"""A topic of two types of velocity, in one process or on the graph: a line, never an end."""

import subprocess
import sys
from types import SimpleNamespace

from geometry_msgs.msg import Twist, TwistStamped
import pytest
import rclpy
from rclpy.parameter import Parameter
from teleop_keyboard.keys_to_twist_node import KeysToTwistNode
from teleop_keyboard.twist_mux_node import TwistMuxNode
from terminals import PATIENCE
from wasd_core.topics import VelocitySubscription

pytestmark = pytest.mark.slow


@pytest.fixture
def there(context):
    """A node of another participant: one cannot have a topic of two types."""
    node = rclpy.create_node('there', context=context)
    yield node
    node.destroy_node()


def taker(*, parameter_overrides):
    node = rclpy.create_node('taker')
    node.cmd_vel = VelocitySubscription(node, lambda velocity, age: True)
    return node


@pytest.mark.parametrize('sends', [False, True])
@pytest.mark.parametrize(
    ('make', 'stamped', 'topic', 'cure'),
    [
        (KeysToTwistNode, False, '/cmd_vel', 'keys_to_twist have TwistStamped (-p stamped:=true)'),
        (KeysToTwistNode, True, '/cmd_vel', 'keys_to_twist have Twist (-p stamped:=false)'),
        (TwistMuxNode, False, '/key_vel', 'twist_mux have TwistStamped (-p stamped:=true)'),
        (taker, False, '/cmd_vel', 'there have Twist (-p stamped:=false)'),
    ],
)
def test_a_peer_of_the_other_type_is_named_once_with_the_cure(
    ros_domain, there, spawn, spin_until, make, stamped, topic, cure, sends
):
    node, said = spawn(make(parameter_overrides=[Parameter('stamped', value=stamped)])), []
    node.get_logger().error = said.append
    ours, theirs = (Twist, TwistStamped)[:: -1 if stamped else 1]
    if sends:
        there.create_publisher(theirs, topic, 10)
    else:
        there.create_subscription(theirs, topic, print, 10)
    spin_until(spawn.pump, lambda: said)
    name, looks = node.get_name(), []
    timer = node.create_timer(0.2, lambda: looks.append(0))
    spin_until(spawn.pump, lambda: len(looks) > 5)
    node.destroy_timer(timer)
    has = f'there has {theirs.__name__}, {name} {ours.__name__}'
    assert said == [f'{topic}: {has}: nothing passes; let {cure}']


def test_a_remapping_that_gives_a_topic_two_types_is_one_line(ros_domain):
    done = subprocess.run(
        [sys.executable, '-m', 'teleop_keyboard.teleop_node', '--ros-args', '-r', 'odom:=cmd_vel'],
        input=b'i',
        capture_output=True,
        start_new_session=True,
        timeout=PATIENCE,
    )
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith(b'error: ROS: Failed to create')
    assert b'Traceback' not in done.stderr


def test_a_peer_is_named_once_its_name_has_come(spawn):
    node, said, names = spawn(rclpy.create_node('taker')), [], ['_NODE_NAME_UNKNOWN_', 'there']
    node.get_logger().error = said.append
    kind = 'geometry_msgs/msg/TwistStamped'
    node.get_publishers_info_by_topic = lambda topic: [
        SimpleNamespace(node_name=names[0], topic_type=kind)
    ]
    VelocitySubscription(node, lambda velocity, age: True)
    (look,) = [each.callback for each in node.timers if 'watch_types' in str(each.callback)]
    look()
    assert said == []
    names.pop(0)
    look()
    assert '/cmd_vel: there has TwistStamped' in said[0]
