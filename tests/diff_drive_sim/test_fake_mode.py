# SPDX-License-Identifier: Apache-2.0
"""Mode fake: no physics, the same topics, and a time-out that works."""

import math

from cases import for_all
from diff_drive_sim.diff_drive_controller_node import DiffDriveControllerNode
from diff_drive_sim.drive import DiffDrive
from diff_drive_sim.odometry import KinematicBase
from diff_drive_sim.parameters import DiffDriveParameters
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

DT = 0.005
URDF = ['left_wheel_joint', 'right_wheel_joint']
ARBOTIX = ['base_l_wheel_joint', 'base_r_wheel_joint']


def test_half_a_circle_ends_on_the_circle(geometry):
    base = KinematicBase(geometry)
    base.step(*geometry.wheel_speeds(0.5, 1.0), math.pi)
    assert (base.pose.x, base.pose.y) == pytest.approx((0.0, 1.0), abs=1e-12)
    # What arbotix does in its fake mode, 10 times a second: 51 mm off after half a circle.
    x = y = yaw = 0.0
    for _ in range(31):
        x, y, yaw = x + 0.05 * math.cos(yaw), y + 0.05 * math.sin(yaw), yaw + 0.1
    off = math.hypot(x - 0.5 * math.sin(3.1), y - 0.5 * (1.0 - math.cos(3.1)))
    assert off == pytest.approx(0.051, abs=0.002)


@pytest.mark.slow
def test_after_the_last_command_the_robot_brakes_and_stands(mbot):
    # arbotix's drives on for ever.
    unit = DiffDrive(mbot, DiffDriveParameters(mode='fake'))
    unit.controller.command(0.4, 0.0)
    speeds = []
    for _ in range(round(2.0 / DT)):
        unit.step_fake(DT)
        speeds.append(unit.fake.pose.linear)
    assert max(speeds) == pytest.approx(0.4)
    # Time-out 0.5 s; 0.4 m/s at 1 m/s^2.
    assert speeds[round(0.49 / DT)] == pytest.approx(0.4)
    assert speeds[round((0.5 + 0.4 + 0.02) / DT)] == pytest.approx(0.0, abs=1e-9)
    # Half a second at speed, less a ramp up, and a ramp down: 0.2 + 0.08 - 0.08 m, and a cycle.
    assert unit.fake.pose.x == pytest.approx(0.2, abs=0.005)
    assert unit.controller.state == 'stopped'


def test_odometry_is_where_the_wheels_have_rolled(mbot):
    unit = DiffDrive(mbot, DiffDriveParameters(mode='fake'))
    for _ in range(300):
        unit.controller.command(0.3, -0.7)
        unit.step_fake(DT)
    seen, true = unit.controller.odometry_state, unit.fake.pose
    assert (seen.x, seen.y, seen.yaw) == pytest.approx((true.x, true.y, true.yaw), abs=1e-12)


@for_all('ticks_meter', [10.0, 98.0, 300.0])
@for_all(('rate', 'speed'), [(20.0, 0.5), (200.0, 0.1), (1000.0, 0.3)])
def test_odometry_by_ticks_is_within_a_tick_however_coarse_they_are(
    mbot, ticks_meter, rate, speed
):
    parameters = DiffDriveParameters(
        mode='fake', odometry_feedback='ticks', ticks_meter=ticks_meter, linear_max_velocity=speed
    )
    unit = DiffDrive(mbot, parameters)
    for _ in range(round(rate)):
        unit.controller.command(1.0, 0.0)
        unit.step_fake(1.0 / rate)
    assert unit.controller.restarts == 0
    assert unit.fake.pose.x > 0.05
    off = unit.controller.odometry_state.x - unit.fake.pose.x
    assert abs(off) <= 0.5 / ticks_meter + 1e-9
    # Encoders that begin again at 0 are still told.
    unit.controller.step(-1e3, -1e3, 1.0 / rate)
    assert unit.controller.restarts == 1


def test_the_wheels_have_turned_as_far_as_the_path_is_long(mbot):
    unit = DiffDrive(mbot, DiffDriveParameters(mode='fake'))
    for _ in range(400):
        unit.controller.command(0.5, 0.0)
        unit.step_fake(DT)
    assert unit.angles == pytest.approx([unit.fake.pose.x / 0.06] * 2, rel=1e-9)


def test_a_reset_puts_it_back(mbot):
    unit = DiffDrive(mbot, DiffDriveParameters(mode='fake'))
    unit.controller.command(0.3, 1.0)
    for _ in range(50):
        unit.step_fake(DT)
    unit.reset()
    unit.step_fake(DT)
    assert (unit.fake.pose.x, unit.fake.pose.yaw, unit.angles) == (0.0, 0.0, (0.0, 0.0))


class Peer(Node):
    """Another node: publishes cmd_vel, collects odometry and joint states."""

    def __init__(self):
        super().__init__('peer')
        self.odometry, self.joints = [], []
        self.create_subscription(Odometry, 'odom', self.odometry.append, 100)
        self.create_subscription(JointState, 'joint_states', self.joints.append, 100)
        self.cmd_vel = self.create_publisher(Twist, 'cmd_vel', 10)


@pytest.fixture
def alone(spawn, spin_until):
    """Return a function that starts the node alone with parameters, and a peer."""

    def start(**parameters):
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        node = spawn(DiffDriveControllerNode(parameter_overrides=overrides))
        peer = spawn(Peer())
        spin_until(spawn.pump, lambda: peer.odometry and peer.joints)
        spin_until(spawn.pump, lambda: peer.cmd_vel.get_subscription_count())
        return node, peer

    return start


@pytest.mark.slow
@pytest.mark.parametrize('parameters', [{'mode': 'fake'}, {'sim': True}])
def test_alone_it_drives_publishes_and_stops_by_itself(alone, spawn, spin_until, parameters):
    node, peer = alone(cmd_vel_timeout=0.2, **parameters)
    message = Twist()
    message.linear.x = 0.1
    peer.cmd_vel.publish(message)
    spin_until(spawn.pump, lambda: node.controller.velocity.linear > 0.05)
    spin_until(spawn.pump, lambda: node.controller.state == 'stopped')
    x = node.controller.odometry_state.x
    assert 0.005 < x < 0.1
    count = len(peer.joints)
    spin_until(spawn.pump, lambda: len(peer.joints) > count + 5)
    assert node.controller.odometry_state.x == x
    last = peer.joints[-1]
    assert last.name == URDF
    assert list(last.position) == pytest.approx([x / 0.06] * 2, rel=1e-3)
    assert list(last.velocity) == [0.0, 0.0]
    assert node.count_publishers('joint_commands') == 0


@pytest.mark.slow
@pytest.mark.parametrize(('names', 'expected'), [('both', URDF + ARBOTIX), ('arbotix', ARBOTIX)])
def test_alone_it_may_have_the_names_of_arbotix(alone, names, expected):
    _, peer = alone(mode='fake', joint_names=names)
    assert peer.joints[-1].name == expected
    assert len(peer.joints[-1].position) == len(expected)
