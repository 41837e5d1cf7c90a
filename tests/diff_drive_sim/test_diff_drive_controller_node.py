# SPDX-License-Identifier: Apache-2.0
import math
from pathlib import Path
import re

from builtin_interfaces.msg import Time
from diff_drive_sim.diff_drive_controller_node import DiffDriveControllerNode
from diff_drive_sim.drive import DiffDrive
from diff_drive_sim.parameters import diff_drive_controller
from geometry_msgs.msg import Twist, TwistStamped
from mujoco_sim.simulator_node import SimulatorNode
from nav_msgs.msg import Odometry
import numpy as np
import pytest
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from wasd_core.node import init_ros

pytestmark = pytest.mark.slow

WHEELS = ['left_wheel_joint', 'right_wheel_joint']


def twist(linear, angular=0.0):
    message = Twist()
    message.linear.x, message.angular.z = linear, angular
    return message


def seconds(stamp):
    return stamp.sec + 1e-9 * stamp.nanosec


class Peer(Node):
    """Another node: publishes cmd_vel and collects odometry, truth and joint commands."""

    def __init__(self):
        super().__init__('peer')
        self.odometry, self.truth, self.commands = [], [], []
        self.create_subscription(Odometry, 'odom', self.odometry.append, 1000)
        self.create_subscription(Odometry, 'ground_truth/odom', self.truth.append, 1000)
        self.create_subscription(JointTrajectory, 'joint_commands', self.commands.append, 1000)
        self.cmd_vel = self.create_publisher(Twist, 'cmd_vel', 10)
        self.states = self.create_publisher(JointState, 'joint_states', 10)

    def publish_state(self, stamp, left, right):
        message = JointState(name=WHEELS, position=[left, right])
        message.header.stamp = Time(sec=int(stamp), nanosec=round(1e9 * (stamp % 1.0)))
        self.states.publish(message)


@pytest.fixture
def driver(spawn):
    return spawn(DiffDriveControllerNode())


@pytest.fixture
def peer(spawn, driver, spin_until):
    peer = spawn(Peer())
    spin_until(
        spawn.pump,
        lambda: peer.cmd_vel.get_subscription_count() and peer.states.get_subscription_count(),
    )
    spin_until(spawn.pump, lambda: driver.count_subscribers('joint_commands'))
    return peer


@pytest.fixture
def feed(peer, spawn, spin_until):
    """Return a function that publishes a joint state and waits for the command it causes."""

    def feed(stamp, left=0.0, right=0.0):
        count = len(peer.commands)
        peer.publish_state(stamp, left, right)
        spin_until(spawn.pump, lambda: len(peer.commands) > count)
        return peer.commands[-1]

    return feed


class Rig:
    """A simulator and a controller that know each other by topics only."""

    def __init__(self, spawn, spin_until, **parameters):
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        self.simulator = spawn(SimulatorNode(parameter_overrides=overrides))
        self.simulator.schedule_publishing()
        self.world = self.simulator._world
        self.driver = spawn(DiffDriveControllerNode(parameter_overrides=overrides))
        self.peer = spawn(Peer())
        self._pump, self._spin_until = spawn.pump, spin_until
        for topic, count in (('joint_commands', 2), ('joint_states', 1), ('cmd_vel', 1)):
            spin_until(self._pump, lambda t=topic, n=count: self.peer.count_subscribers(t) >= n)
        spin_until(self._pump, self._answers, step=lambda: self.simulator.simulation.advance(20))

    def run(self, duration, velocity=None):
        """Simulate; every state is answered before the next, so that the host does not matter."""
        for index in range(round(duration / 0.02)):
            if velocity is not None and index % 5 == 0:
                self.peer.cmd_vel.publish(twist(*velocity))
                self._spin_until(self._pump, lambda: self.driver.controller._is_new)
            self.simulator.simulation.advance(20)
            self._spin_until(self._pump, self._answers)

    @property
    def speed(self):
        """The true forward speed [m/s]."""
        return self.world.base().planar_velocity[0]

    def _answers(self):
        return self.simulator._commanded_at == self.world.time


@pytest.fixture
def rig(spawn, spin_until):
    return Rig(spawn, spin_until)


def test_cmd_vel_drives_the_simulated_robot_over_topics(rig):
    rig.run(1.0, (0.2, 0.0))
    assert rig.speed == pytest.approx(0.2, rel=0.02)


def test_the_robot_stops_half_a_second_and_a_ramp_after_the_last_cmd_vel(rig):
    rig.run(0.5, (0.2, 0.0))  # the last command is sent at 0.4 s
    rig.run(0.36)
    assert rig.speed == pytest.approx(0.2, rel=0.02)
    # 0.2 m/s at 1 m/s^2, and two states of 0.02 s; then the wheels' own lag.
    rig.run(0.04 + 0.2 + 0.04 + 0.10)
    assert rig.speed == pytest.approx(0.0, abs=2e-3)
    before = rig.world.base().position[0]
    rig.run(0.5)
    assert rig.world.base().position[0] == pytest.approx(before, abs=1e-3)


def test_odometry_over_topics_agrees_with_the_truth(rig, spawn, spin_until):
    rig.run(1.2, (0.3, 0.8))
    rig.run(0.8, (0.0, 0.0))
    truth = rig.world.base()
    pose = rig.driver.controller.odometry_state
    assert math.hypot(*truth.position[:2]) > 0.2
    assert np.hypot(pose.x - truth.position[0], pose.y - truth.position[1]) < 1e-3
    assert pose.yaw == pytest.approx(truth.rpy[2], abs=math.radians(0.1))


def test_a_reset_of_the_simulator_moves_no_odometry_and_is_said(rig, capfd):
    rig.run(1.5, (0.4, 0.0))
    before = rig.driver.controller.odometry_state
    rig.simulator.simulation.reset()
    rig.run(0.02)
    after = rig.driver.controller.odometry_state
    assert (after.x, after.yaw) == pytest.approx((before.x, before.yaw), abs=0.02)
    assert abs(after.linear) < 0.5
    assert capfd.readouterr().err.count('wheel angles have jumped') == 1


def test_odometry_comes_at_50_hz_with_the_stamp_of_the_state(rig, spawn, spin_until):
    count = len(rig.peer.odometry)
    rig.run(0.4)
    spin_until(spawn.pump, lambda: len(rig.peer.odometry) >= count + 20)
    stamps = [seconds(message.header.stamp) for message in rig.peer.odometry[-20:]]
    np.testing.assert_allclose(np.diff(stamps), 0.02, atol=1e-9)
    assert rig.peer.odometry[-1].header.frame_id == 'odom'
    assert rig.peer.odometry[-1].child_frame_id == 'base_footprint'


def test_a_state_is_answered_with_wheel_speeds_and_gains(driver, peer, feed):
    driver.cmd_vel.hear(twist(0.2))
    feed(1.0)
    command = feed(1.02)
    assert list(command.joint_names) == WHEELS
    setpoint, gains = command.points
    # 1 m/s^2 for 0.02 s on a radius of 0.06 m.
    assert list(setpoint.velocities) == pytest.approx([0.02 / 0.06] * 2)
    assert list(gains.velocities) == pytest.approx([0.3] * 2)
    assert list(gains.positions) == [0.0, 0.0]


@pytest.mark.parametrize('angle', [math.nan, math.inf])
def test_wheel_angles_that_are_not_finite_are_ignored_with_one_warning(peer, feed, capfd, angle):
    peer.states.publish(JointState(name=WHEELS, position=[angle, 0.0]))
    peer.states.publish(JointState(name=WHEELS, position=[0.0, angle]))
    feed(1.0)  # alive
    said = capfd.readouterr().err
    assert said.count('joint_states: wanted finite wheel angles: ignored') == 1


def test_after_a_gap_it_eases_in(driver, feed):
    driver.cmd_vel.hear(twist(1.0))
    feed(1.0)
    driver.controller.command(1.0, 0.0)
    driver.unit.control(0.0, 0.0, 59.0)  # the command has come in the end
    assert driver.controller.velocity.linear == pytest.approx(0.1)  # 0.1 s, not 59


def test_a_clock_that_jumps_back_moves_nothing(driver, feed):
    driver.cmd_vel.hear(twist(1.0))
    feed(5.0)
    feed(5.02)
    speed = driver.controller.velocity.linear
    feed(1.0)
    assert driver.controller.velocity.linear == speed
    feed(1.02)
    assert driver.controller.velocity.linear > speed


@pytest.mark.parametrize(
    'state',
    [
        JointState(name=['left_wheel_joint'], position=[1.0]),
        JointState(name=WHEELS, position=[1.0]),
        JointState(name=WHEELS, velocity=[1.0, 1.0]),
    ],
)
def test_a_state_without_the_wheels_is_ignored_with_one_warning(peer, feed, capfd, state):
    peer.states.publish(state)
    peer.states.publish(state)
    feed(1.0)  # alive
    said = capfd.readouterr().err
    assert said.count('joint_states lacks left_wheel_joint or right_wheel_joint: ignored') == 1


def test_cmd_vel_that_is_not_finite_is_ignored_with_one_warning(
    driver, peer, spawn, spin_until, capfd
):
    peer.cmd_vel.publish(twist(0.2))
    for _ in range(3):
        peer.cmd_vel.publish(twist(math.nan))
    spin_until(spawn.pump, lambda: driver.controller.refused_commands == 3)
    assert driver.controller.target.linear == 0.2
    assert capfd.readouterr().err.count('cmd_vel is not finite') == 1


def test_stamped_commands_are_taken_by_a_stamped_controller(isolated_ros, mbot):
    init_ros(['--ros-args', '-p', 'stamped:=true'])
    node = DiffDriveControllerNode(DiffDrive(mbot))
    try:
        message = TwistStamped()
        message.twist.linear.x = 0.3
        node.cmd_vel.hear(message)
        assert node.controller.target.linear == 0.3
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def test_limits_can_be_changed_while_it_drives(driver):
    def set_to(name, value):
        return driver.set_parameters([Parameter(name, value=value)])[0]

    assert set_to('linear.x.max_velocity', 0.1).successful
    driver.cmd_vel.hear(twist(5.0))
    assert driver.controller.target.linear == 0.1
    refused = set_to('linear.x.max_velocity', 0.0)
    assert not refused.successful
    assert (
        refused.reason
        == 'linear.x.max_velocity must be >= 0.001 and <= 100 m/s, or NaN: no limit, got 0.0'
    )
    assert 'read-only' in set_to('odom_frame_id', 'map').reason


def test_closing_leaves_the_wheels_stopped(driver):
    driver.cmd_vel.hear(twist(0.5))
    driver.unit.control(0.0, 0.0, 0.1)
    driver.close()
    np.testing.assert_array_equal(driver.unit.control(0.0, 0.0, 0.1).velocity, [0.0, 0.0])


def test_a_drive_that_it_is_given_is_fed_by_no_topic(spawn, mbot):
    node = spawn(DiffDriveControllerNode(DiffDrive(mbot)))
    assert node.count_publishers('joint_commands') == 0
    assert node.count_subscribers('joint_states') == 0


@pytest.mark.parametrize(
    ('override', 'message'),
    [
        ('description:=dog', 'dog: no such file'),
        (
            'linear.x.max_velocity:=-1.0',
            'diff_drive_controller: linear.x.max_velocity must be >= 0.001 and <= 100 m/s, or NaN',
        ),
        ('description:=5', "diff_drive_controller: Trying to set parameter 'description'"),
    ],
)
def test_as_a_process_it_says_what_is_wrong_in_one_line(isolated_ros, capsys, override, message):
    assert diff_drive_controller(['--ros-args', '-p', override]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f'error: {message}')
    assert said.count('\n') == 1


def test_a_controller_of_its_own_says_once_that_wheels_slip(spawn, spin_until, capfd):
    description = Path(__file__).parents[1] / 'catalogue/wheels/dragging.xacro'
    rig = Rig(spawn, spin_until, description=str(description))
    rig.run(4.0, (0.3, 0.0))
    (share,) = re.findall(r'wheels slip or hang in the air: (-?\d+) %', capfd.readouterr().err)
    assert 0 <= int(share) < 75
