# SPDX-License-Identifier: Apache-2.0
"""The guard on topics: what it relays, and what it does without sensors."""

from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String
from wasd_core.messages import to_stamp
from wasd_core.rotations import Pose
from wasd_core.topics import LATCHED, RELIABLE
from wasd_navigation.guard_node import GuardNode, main

NOW = 100.0


@pytest.fixture
def guard(spawn):
    """Return a guard of a round robot whose lidar is in its middle."""
    node = spawn(GuardNode(parameter_overrides=[Parameter('robot_radius', value=0.2)]))
    node.senses.place_frame('laser', 'base', Pose(np.array((0.0, 0.0, 0.2)), np.eye(3)))
    return node


@pytest.fixture
def drive(spawn, spin_until, guard):
    """Return a function that asks for a speed ahead, and returns what is relayed."""
    peer, got, said = spawn(Node('peer')), [], []
    asks = peer.create_publisher(Twist, 'cmd_vel_smoothed', RELIABLE)
    peer.create_subscription(Twist, 'cmd_vel', got.append, RELIABLE)
    peer.create_subscription(String, 'guard/state', said.append, LATCHED)
    spin_until(
        spawn.pump, lambda: asks.get_subscription_count() and peer.count_publishers('cmd_vel')
    )

    def drive(speed):
        got.clear()
        twist = Twist()
        twist.linear.x = speed
        asks.publish(twist)
        spin_until(spawn.pump, lambda: got)
        return got[0].linear.x, [message.data for message in said]

    return drive


def sense(guard, distance: float) -> None:
    """Give it odometry and a scan of now, in which a wall is so far ahead."""
    odometry = Odometry(child_frame_id='base')
    odometry.header.frame_id = 'odom'
    odometry.pose.pose.orientation.w = 1.0
    odometry.header.stamp = to_stamp(NOW)
    guard._on_odometry(odometry)
    angles = np.arange(-1.0, 1.0, 0.02)
    scan = LaserScan(angle_min=-1.0, angle_increment=0.02, range_min=0.05, range_max=8.0)
    scan.header.stamp, scan.header.frame_id = to_stamp(NOW), 'laser'
    scan.ranges = (distance / np.cos(angles)).tolist()
    guard._on_scan(scan)


def test_a_velocity_passes_where_nothing_is_near(guard, drive) -> None:
    sense(guard, 4.0)
    assert drive(0.5)[0] == 0.5


def test_towards_a_wall_less_of_it_passes_and_it_says_why(guard, drive) -> None:
    sense(guard, 0.2 + 0.03 + 0.1)
    speed, said = drive(0.5)
    assert speed == pytest.approx(0.1, rel=0.05)
    assert said[-1] == 'approach: something is 0.13 m ahead'
    assert drive(-0.5)[0] == -0.5


def test_without_a_scan_nothing_passes(guard, drive) -> None:
    speed, said = drive(0.5)
    assert speed == 0.0
    assert said[-1] == 'stop: the lidar is silent'


def test_a_topic_that_is_none_is_one_line(isolated_ros, capfd) -> None:
    given = ('-p', 'robot_radius:=0.2', '-p', 'cmd_vel_in_topic:=cmd-vel')
    assert main(['--ros-args', *given]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith('error: ROS: Invalid topic name: ')
    assert line.endswith(": 'cmd-vel'")
