# SPDX-License-Identifier: Apache-2.0
import math

from builtin_interfaces.msg import Time
from mujoco_sim.simulator_node import SimulatorNode
from mujoco_sim.truth_publisher import to_odometry_error
from nav_msgs.msg import Odometry
import pytest
from rclpy.node import Node
from sensor_msgs.msg import JointState

pytestmark = pytest.mark.slow


def odometry(x, y, yaw, stamp=None):
    message = Odometry()
    message.header.frame_id, message.child_frame_id = 'odom', 'base_footprint'
    message.header.stamp = stamp or Time()
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation.w = math.cos(yaw / 2)
    message.pose.pose.orientation.z = math.sin(yaw / 2)
    message.twist.twist.linear.x = 0.5
    return message


def yaw_of(message):
    turn = message.pose.pose.orientation
    return 2.0 * math.atan2(turn.z, turn.w)


def test_the_error_is_the_truth_minus_odometry():
    error = to_odometry_error(odometry(1.0, 2.0, 0.3), odometry(0.75, 2.5, -0.2))
    assert (error.pose.pose.position.x, error.pose.pose.position.y) == (0.25, -0.5)
    assert yaw_of(error) == pytest.approx(0.5)
    assert error.twist.twist.linear.x == 0.0
    assert (error.header.frame_id, error.child_frame_id) == ('odom', 'base_footprint')


def test_the_turn_of_an_error_is_what_leads_from_odometry_to_the_truth_in_three_dimensions():
    true, estimated = odometry(0.0, 0.0, 0.0), odometry(0.0, 0.0, 0.0)
    for message, (w, x, y, z) in ((true, (0.5, 0.5, 0.5, 0.5)), (estimated, (0.8, 0.0, 0.6, 0.0))):
        turn = message.pose.pose.orientation
        turn.w, turn.x, turn.y, turn.z = w, x, y, z
    turn = to_odometry_error(true, estimated).pose.pose.orientation
    # (0.5 + 0.5i + 0.5j + 0.5k)(0.8 - 0.6j), by hand.
    assert (turn.w, turn.x, turn.y, turn.z) == pytest.approx((0.7, 0.7, 0.1, 0.1))


class Rig:
    """A simulator, a source of odometry, and somebody who listens to its error."""

    def __init__(self, spawn, spin_until, loaded, world):
        self.node = spawn(SimulatorNode(loaded, world))
        self.node.schedule_publishing()
        self.peer = spawn(Node('peer'))
        self.truths, self.errors, self.slips = [], [], []
        self.odometry = self.peer.create_publisher(Odometry, 'odom', 10)
        self.peer.create_subscription(Odometry, 'ground_truth/odom', self.truths.append, 10)
        self.pump, self._spin_until = spawn.pump, spin_until

    def listen(self):
        self.peer.create_subscription(Odometry, 'odom_error', self.errors.append, 10)
        self.wait(lambda: self.is_listening)

    def wait(self, condition):
        self._spin_until(self.pump, condition, step=lambda: self.node.simulation.advance(1))

    @property
    def is_listening(self):
        return self.odometry.get_subscription_count() > 0


@pytest.fixture
def rig(spawn, spin_until, loaded, world):
    return Rig(spawn, spin_until, loaded, world)


def test_each_odometry_is_compared_with_the_truth_of_its_own_instant(rig, world):
    rig.listen()
    world.data.qvel[0] = 0.5
    rig.wait(lambda: rig.truths)
    truth = rig.truths[-1]
    rig.node.simulation.advance(200)  # the odometry of that instant is 0.2 s late
    rig.odometry.publish(odometry(-0.25, 0.125, 0.1, truth.header.stamp))
    rig.wait(lambda: rig.errors)
    error = rig.errors[0]
    assert error.header.stamp == truth.header.stamp
    true = truth.pose.pose.position
    place = error.pose.pose.position
    assert (place.x, place.y) == (true.x + 0.25, true.y - 0.125)
    assert yaw_of(error) == pytest.approx(-0.1, abs=1e-6)


def test_odometry_of_another_time_is_said_to_be_so(rig, capfd):
    rig.listen()
    rig.odometry.publish(odometry(0.0, 0.0, 0.0, Time(sec=1700000000)))
    said = []

    def has_said():
        said.append(capfd.readouterr().err)
        return 'no stamp of this simulation' in ''.join(said)

    rig.wait(has_said)
    assert rig.errors == []


def test_odometry_is_listened_to_only_while_somebody_wants_its_error(rig):
    for _ in range(20):
        rig.node.simulation.advance(10)
        rig.pump.handle(0.005)
    assert not rig.is_listening
    rig.listen()
    (subscription,) = (s for s in rig.peer.subscriptions if s.topic_name == '/odom_error')
    rig.peer.destroy_subscription(subscription)
    rig.wait(lambda: not rig.is_listening)


def test_the_slip_of_the_wheels_is_told_by_joint(rig, world, spin_until):
    rig.peer.create_subscription(JointState, 'wheel_slip', rig.slips.append, 10)
    world.data.qvel[0] = 0.3  # the wheels have not begun to turn
    rig.wait(lambda: rig.slips)
    slip = rig.slips[0]
    assert list(slip.name) == ['left_wheel_joint', 'right_wheel_joint']
    assert len(slip.position) == len(slip.velocity) == 2


def test_handed_over_the_error_is_of_the_odometry_of_now(rig, world):
    rig.peer.create_subscription(Odometry, 'odom_error', rig.errors.append, 10)
    world.data.qpos[0] = 1.0
    stamp = Time(sec=3)
    rig.wait(lambda: rig.node.truth.compare(lambda: odometry(0.5, 0.25, 0.0, stamp)) or rig.errors)
    place = rig.errors[0].pose.pose.position
    assert (place.x, place.y) == (0.5, pytest.approx(-0.25, abs=1e-9))
    assert rig.errors[0].header.stamp == stamp


def test_odometry_to_hand_over_is_not_even_made_while_nobody_listens(rig):
    rig.node.truth.compare(lambda: pytest.fail('nobody listens'))
