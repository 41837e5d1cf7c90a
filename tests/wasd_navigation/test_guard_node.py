# SPDX-License-Identifier: Apache-2.0
"""The guard on topics: what it relays, and what it does without sensors."""

import time

from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time import ClockType, Time
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String
from wasd_core.messages import to_stamp
from wasd_core.rotations import Pose
from wasd_core.topics import LATCHED, RELIABLE
from wasd_navigation.guard_node import GuardNode
from wasd_navigation.guard_parameters import guard as run_guard

pytestmark = pytest.mark.slow

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
    look(guard, distance / np.cos(np.arange(-1.0, 1.0, 0.02)), NOW)


def look(guard, ranges: np.ndarray, now: float) -> None:
    """Give it odometry and a scan of a time [s]."""
    odometry = Odometry(child_frame_id='base')
    odometry.header.frame_id = 'odom'
    odometry.pose.pose.orientation.w = 1.0
    odometry.header.stamp = to_stamp(now)
    guard._on_odometry(odometry)
    scan = LaserScan(angle_min=-1.0, angle_increment=0.02, range_min=0.05, range_max=8.0)
    scan.header.stamp, scan.header.frame_id = to_stamp(now), 'laser'
    scan.ranges = ranges.tolist()
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
    assert said[-1] == 'stop: odometry is silent'


@pytest.fixture
def idle(guard):
    """Return a function that sees the same ranges for a while [s] at 10 Hz, without a command."""
    clock, now = guard.get_clock(), NOW
    clock._set_ros_time_is_active(True)

    def idle(seconds: float, ranges: np.ndarray) -> None:
        nonlocal now
        for _ in range(round(10.0 * seconds)):
            now += 0.1
            clock.set_ros_time_override(Time(seconds=now, clock_type=ClockType.ROS_TIME))
            guard.step()
            look(guard, ranges, now)

    return idle


def command(guard, speed: float, age: int = 0) -> float:
    """Ask, so long ago [s], for a speed ahead; return what of it passes."""
    twist = Twist()
    twist.linear.x = speed
    guard._on_velocity(twist, {'source_timestamp': time.time_ns() - age * 10**9})
    return float(guard.guard.last.velocity[0])


def test_after_a_rest_a_command_passes_at_once(guard, idle) -> None:
    idle(0.2, np.full(100, 4.0))
    command(guard, 0.3)
    idle(4.0, np.full(100, 4.0))
    assert command(guard, 0.3) == 0.3


def test_with_a_lidar_that_is_blind_nothing_passes(guard, idle) -> None:
    idle(0.2, np.full(100, 4.0))
    idle(0.6, np.full(100, np.nan))
    assert command(guard, 0.3) == 0.0
    assert guard.guard.last.why == 'the lidar is silent or blind for 0.6 s'


def test_what_was_hidden_while_it_rested_is_still_there(guard, idle) -> None:
    # 10 cm before the robot, and then nearer than the lidar sees.
    far, box, hidden = np.full((3, 100), 3.0)
    box[44:56], hidden[44:56] = 0.3, 0.0
    idle(0.1, far)
    command(guard, 0.0)
    idle(10.0, far)
    idle(4.0, box)
    idle(1.0, hidden)
    command(guard, 0.3)
    idle(0.1, hidden)
    assert command(guard, 0.3) < 0.15
    assert guard.guard.last.why.endswith(' m ahead')


def test_what_was_asked_before_or_while_it_was_stopped_is_not_relayed(guard, monkeypatch) -> None:
    relayed: list[float] = []
    monkeypatch.setattr(guard, '_publish', lambda velocity: relayed.append(velocity[0]))
    sense(guard, 4.0)
    command(guard, 0.3)
    guard._absence._absence._lived_at -= 4.0  # as if the process had been stopped
    command(guard, 0.5, age=1)
    sense(guard, 0.2 + 0.03 + 0.1)  # the command before would be limited now
    guard.step()
    assert relayed == [0.3, 0.0]
    command(guard, -0.2)
    assert relayed == [0.3, 0.0, -0.2]


def test_a_topic_that_is_none_is_one_line(isolated_ros, capfd) -> None:
    given = ('-p', 'robot_radius:=0.2', '-p', 'cmd_vel_in_topic:=cmd-vel')
    assert run_guard(['--ros-args', *given]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith('error: ROS: Invalid topic name: ')
    assert line.endswith(": 'cmd-vel'")
