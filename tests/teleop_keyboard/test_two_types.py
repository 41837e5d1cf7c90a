# SPDX-License-Identifier: Apache-2.0
"""A topic of two types of velocity, in one process or on the graph: a warning, never an end."""

import subprocess
import sys

from geometry_msgs.msg import Twist, TwistStamped
import pytest
import rclpy
from rclpy.parameter import Parameter
from std_msgs.msg import String
from teleop_keyboard.keys_to_twist_node import KeysToTwistNode
from teleop_keyboard.twist_mux_node import TwistMuxNode
from terminals import PATIENCE
from wasd_core.parameters import InvalidParameter

pytestmark = pytest.mark.slow


@pytest.fixture
def here(spawn):
    """A node of this process, so of one participant with the node under test."""
    return spawn(rclpy.create_node('here'))


@pytest.fixture
def there(context):
    """A node of another participant."""
    node = rclpy.create_node('there', context=context)
    yield node
    node.destroy_node()


def warnings_of(node):
    node.warnings = []
    node.get_logger().warning = lambda text, **_: node.warnings.append(text)
    return node.warnings


@pytest.mark.parametrize('message_type', [Twist, TwistStamped])
def test_auto_takes_the_type_that_its_process_has(
    ros_domain, here, spawn, spin_until, message_type
):
    heard = []
    here.create_subscription(message_type, 'cmd_vel', heard.append, 10)
    teleop = spawn(KeysToTwistNode())
    teleop.keys.hear(String(data='i'))
    spin_until(spawn.pump, lambda: heard)
    twist = getattr(heard[0], 'twist', heard[0])
    # A press's first message is what the ramp reaches in one period.
    assert twist.linear.x == pytest.approx(0.6 / 50)


def test_a_type_that_its_process_rules_out_is_one_line(ros_domain, here):
    here.create_subscription(TwistStamped, 'cmd_vel', print, 10)
    with pytest.raises(InvalidParameter, match='/cmd_vel is TwistStamped in this process'):
        KeysToTwistNode(parameter_overrides=[Parameter('stamped', value=False)])


def test_it_keeps_its_type_where_the_process_holds_it_and_warns_once(
    ros_domain, here, there, spawn, spin_until
):
    here.create_publisher(Twist, 'cmd_vel', 10)
    teleop = spawn(KeysToTwistNode())
    warnings = warnings_of(teleop)
    there.create_subscription(TwistStamped, 'cmd_vel', print, 10)
    spin_until(spawn.pump, lambda: warnings)
    for _ in range(10):
        teleop.output.look()
    (warning,) = warnings
    assert warning.startswith('/cmd_vel: there has TwistStamped, this sends Twist')
    sent = []
    teleop.output.receivers.append(sent.append)
    teleop.keys.hear(String(data='i'))
    assert type(sent[0]) is Twist


@pytest.mark.parametrize(('ours', 'theirs'), [(False, TwistStamped), (True, Twist)])
def test_another_publisher_of_the_other_type_is_told_of_too(
    ros_domain, there, spawn, spin_until, ours, theirs
):
    teleop = spawn(KeysToTwistNode(parameter_overrides=[Parameter('stamped', value=ours)]))
    warnings = warnings_of(teleop)
    there.create_publisher(theirs, 'cmd_vel', 10)
    spin_until(spawn.pump, lambda: warnings)
    assert warnings[0].startswith(f'/cmd_vel: there has {theirs.__name__}')


def test_the_mux_keeps_a_sources_type_where_the_process_holds_it(
    ros_domain, here, there, spawn, spin_until
):
    here.create_publisher(Twist, 'key_vel', 10)
    mux = spawn(TwistMuxNode())
    warnings = warnings_of(mux)
    # Two types on the topic leave it as it is; the one of the graph alone would be followed.
    publisher = there.create_publisher(TwistStamped, 'key_vel', 10)
    mux.get_publishers_info_by_topic = lambda topic: [
        info for info in there.get_publishers_info_by_topic(topic) if info.node_name == 'there'
    ]
    spin_until(spawn.pump, lambda: warnings)
    assert warnings == ['key_vel is Twist in this process: stays']
    there.destroy_publisher(publisher)


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
