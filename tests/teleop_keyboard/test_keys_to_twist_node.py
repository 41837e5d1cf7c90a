# SPDX-License-Identifier: Apache-2.0
import sys
import time

from geometry_msgs.msg import Twist, TwistStamped
import programs
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from std_msgs.msg import String
from teleop_keyboard.key_publisher_node import KeyPublisherNode
from teleop_keyboard.keymap_file import load_preset
from teleop_keyboard.keys_to_twist import KeysToTwist, STANDSTILL
from teleop_keyboard.keys_to_twist_node import KeysToTwistNode
from teleop_keyboard.twist_messages import from_twist
from terminals import PATIENCE
from wasd_core.parameters import InvalidParameter

pytestmark = pytest.mark.slow


@pytest.fixture
def ros(ros_domain):
    rclpy.init(domain_id=ros_domain)
    yield
    rclpy.try_shutdown()


@pytest.fixture
def make_node(ros):
    nodes = []

    def make(**parameters):
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        logic = KeysToTwist(load_preset(parameters.get('preset', 'mbot')))
        nodes.append(KeysToTwistNode(logic, parameter_overrides=overrides))
        nodes[-1].received = []
        nodes[-1].output.receivers.append(nodes[-1].received.append)
        return nodes[-1]

    yield make
    for node in nodes:
        node.destroy_node()


def test_keys_put_in_come_out_as_twists_in_the_same_instant(make_node):
    node = make_node()
    node.keys.hear(String(data='i'))
    for _ in range(100):
        node.step(0.002)
    assert isinstance(node.received[0], Twist)
    assert from_twist(node.received[0]).vx == pytest.approx(0.6 * 0.002)
    assert from_twist(node.received[-1]).vx == pytest.approx(0.6 * 0.2, rel=0.1)


def test_the_same_keys_give_the_same_messages(make_node):
    def run():
        node = make_node()
        for index in range(1000):
            if index % 15 == 0 and index < 500:
                node.keys.hear(String(data='u'))
            node.step(0.002)
        return node.received

    assert run() == run()


def test_closing_leaves_a_moving_robot_stopped(make_node):
    node = make_node()
    node.keys.hear(String(data='i'))
    node.step(0.3)
    node.close()
    assert from_twist(node.received[-1]) == STANDSTILL


def test_a_stop_is_handed_over_without_time_passing(make_node):
    node = make_node()
    node.keys.hear(String(data='i'))
    node.step(0.3)
    node.logic.stop()
    node.step(0.0)
    assert from_twist(node.received[-1]) == STANDSTILL


def test_parameters_of_the_tutorials_change_the_speed(make_node):
    node = make_node(scale_linear=0.1)
    node.keys.hear(String(data='i'))
    node.step(0.5)
    assert from_twist(node.received[-1]).vx == 0.1
    (result,) = node.set_parameters([Parameter('speed', value=0.3)])
    assert result.successful
    node.step(0.05)
    assert node.logic.target.vx == 0.3


def test_an_illegal_parameter_is_rejected_at_start_and_while_running(make_node):
    for name, value, said in (
        ('preset', 'mbto', "^unknown preset 'mbto'"),
        ('speed', 7.0, '^speed must be within'),
    ):
        with pytest.raises(InvalidParameter, match=said):
            KeysToTwistNode(parameter_overrides=[Parameter(name, value=value)])
    node = make_node()
    (result,) = node.set_parameters([Parameter('speed', value=3.0)])
    assert not result.successful
    assert 'speed must be within 0.02 .. 1' in result.reason
    (result,) = node.set_parameters([Parameter('preset', value='ramps')])
    assert not result.successful
    assert node.logic.speed == 0.2


def test_stamped_messages_carry_the_frame_and_the_time_of_the_node(make_node):
    node = make_node(stamped=True, frame_id='base')
    node.keys.hear(String(data='i'))
    node.step(0.1)
    message = node.received[-1]
    assert isinstance(message, TwistStamped)
    assert message.header.frame_id == 'base'
    assert message.header.stamp.sec > 0
    assert from_twist(message).vx == pytest.approx(0.06)


def test_a_key_that_was_handed_over_is_not_handled_again_when_it_comes_back(ros):
    twist, keys = KeysToTwistNode(KeysToTwist(load_preset('mbot'))), KeyPublisherNode()
    keys.receivers += [twist.keys.expect, twist.keys.hear]
    executor = SingleThreadedExecutor()
    executor.add_node(twist)
    executor.add_node(keys)
    while not keys.has_subscriber:
        executor.spin_once(timeout_sec=0.05)
    for _ in range(3):
        keys.publish_key('q')
    end = time.monotonic() + 0.5
    while time.monotonic() < end:
        executor.spin_once(timeout_sec=0.05)
    assert twist.logic.speed == pytest.approx(0.2 * 1.1**3)
    executor.shutdown()
    twist.destroy_node()
    keys.destroy_node()


def test_keys_that_cancelled_each_other_are_forgotten_when_the_next_one_comes(ros):
    node = KeysToTwistNode(parameter_overrides=[Parameter('preset', value='wasd')])
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    for key in 'ws':
        node.keys.hear(String(data=key))
    end = time.monotonic() + 1.5
    while time.monotonic() < end:
        executor.spin_once(timeout_sec=0.01)
    node.keys.hear(String(data='s'))
    assert node.logic.motion.hold.held == ('s',)
    executor.shutdown()
    node.destroy_node()


def test_alone_it_follows_its_own_clock(ros):
    node = KeysToTwistNode()
    received = []
    node.output.receivers.append(
        lambda message: received.append((time.monotonic(), from_twist(message)))
    )
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while not received or received[-1][1].vx < 0.2:
        # Held: of one press, a machine that is busy may tell nothing before it is over.
        node.keys.hear(String(data='i'))
        executor.spin_once(timeout_sec=0.01)
    held_until = time.monotonic()
    while received[-1][1] != STANDSTILL:
        executor.spin_once(timeout_sec=0.01)
    assert max(velocity.vx for _, velocity in received) == 0.2
    # The ramp down takes 1/3 s; a busy machine is later.
    assert received[-1][0] - held_until > 1 / 3
    node.set_parameters([Parameter('rate', value=100.0)])
    assert node.logic.rate == 100.0
    node.close()
    executor.shutdown()
    node.destroy_node()


def test_a_wrong_parameter_ends_the_process_with_one_line(ros_domain):
    command = [sys.executable, '-m', 'teleop_keyboard.keys_to_twist_node']
    words = ('--ros-args', '-p', 'preset:=/nowhere/mine.yaml')
    result = programs.run([*command, *words], text=True, timeout=PATIENCE)
    assert result.returncode == 2
    (line,) = result.stderr.splitlines()
    assert line.startswith('error: /nowhere/mine.yaml: cannot read the keymap')
