# SPDX-License-Identifier: Apache-2.0
"""The node: keys and cmd_vel in, commands, odometry, state and a service out, on real topics."""

import re
import time

from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from quadruped_sim.keys import StateName
from quadruped_sim.leg_controller_node import LegControllerNode
from quadruped_sim.leg_kinematics import LEGS
from quadruped_sim.legs import Legs
from quadruped_sim.parameters import leg_controller
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from terminals import PATIENCE
from trajectory_msgs.msg import JointTrajectory
from wasd_core.messages import to_stamp
from wasd_core.paired import LONGEST_GAP
from wasd_core.robot_io import JointStates
from wasd_core.topics import tf_message_type

pytestmark = pytest.mark.slow

PERIOD = 0.002
JOINT_NAMES = tuple(f'{leg}_{part}_joint' for leg in LEGS for part in ('hip', 'thigh', 'calf'))
STAND = [0.0, 0.8, -1.6] * 4
RESTING = JointStates(np.array(STAND), np.zeros(12), np.zeros(12))


def twist(vx, vy=0.0, wz=0.0):
    message = Twist()
    message.linear.x, message.linear.y, message.angular.z = vx, vy, wz
    return message


def seconds(stamp):
    return stamp.sec + 1e-9 * stamp.nanosec


class Peer(Node):
    """Another node: presses keys, drives, feeds readings and collects what comes back."""

    def __init__(self):
        super().__init__('peer')
        self.states, self.commands, self.odometry = [], [], []
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(String, 'state', lambda m: self.states.append(m.data), latched)
        self.create_subscription(Odometry, 'odom', self.odometry.append, 1000)
        self.create_subscription(JointTrajectory, 'joint_commands', self.commands.append,
                                 qos_profile_sensor_data)  # fmt: skip
        self.keys = self.create_publisher(String, 'keys', 100)
        self.cmd_vel = self.create_publisher(Twist, 'cmd_vel', 10)
        self.imu = self.create_publisher(Imu, 'imu/data', 10)
        self.joints = self.create_publisher(JointState, 'joint_states', 10)
        self.e_stop = self.create_client(Trigger, 'leg_controller/e_stop')

    def press(self, key):
        self.keys.publish(String(data=key))


@pytest.fixture
def node(spawn):
    return spawn(LegControllerNode())


@pytest.fixture
def legs(node):
    return node.legs


@pytest.fixture
def readings(node):
    return node.readings


@pytest.fixture
def peer(spawn, node, spin_until):
    peer = spawn(Peer())
    talks = (peer.keys, peer.cmd_vel, peer.imu, peer.joints)
    spin_until(spawn.pump, lambda: all(talk.get_subscription_count() for talk in talks))
    for topic in ('joint_commands', 'odom', 'state'):
        spin_until(spawn.pump, lambda topic=topic: node.count_subscribers(topic))
    return peer


@pytest.fixture
def feed(peer, spawn, spin_until):
    """Return a function that publishes a standing robot's reading and waits for the command."""

    def feed(stamp, names=JOINT_NAMES, positions=STAND):
        imu = Imu()
        imu.header.stamp = to_stamp(stamp)
        imu.orientation.w = 1.0
        imu.linear_acceleration.z = 9.81
        peer.imu.publish(imu)
        zeros = [0.0] * len(names)
        joints = JointState(
            name=list(names), position=list(positions), velocity=zeros, effort=zeros
        )
        joints.header.stamp = to_stamp(stamp)
        count = len(peer.commands)
        peer.joints.publish(joints)
        spin_until(spawn.pump, lambda: len(peer.commands) > count)
        return peer.commands[-1]

    return feed


@pytest.fixture
def alive(peer, readings, spawn, spin_until):
    """Bring the node to its second reading: the first one only starts its clock."""
    imu, joints = Imu(), JointState(name=list(JOINT_NAMES), position=STAND)
    joints.velocity = joints.effort = [0.0] * 12
    imu.orientation.w, imu.linear_acceleration.z = 1.0, 9.81
    joints.header.stamp = imu.header.stamp = to_stamp(0.9)
    peer.imu.publish(imu)
    spin_until(spawn.pump, lambda: readings._imu is not None)
    peer.joints.publish(joints)
    spin_until(spawn.pump, lambda: readings.last is not None)


@pytest.mark.usefixtures('alive')
def test_a_reading_is_answered_with_a_command_of_its_stamp_for_all_joints(feed):
    command = feed(1.0)
    assert tuple(command.joint_names) == JOINT_NAMES
    assert seconds(command.header.stamp) == 1.0
    setpoint, gains = command.points
    assert len(setpoint.positions) == len(gains.velocities) == 12
    # Passive: it only damps.
    assert list(gains.positions) == [0.0] * 12
    assert min(gains.velocities) > 0.0
    assert list(setpoint.effort) == [0.0] * 12


@pytest.mark.usefixtures('alive')
def test_joints_may_come_in_any_order(feed, legs):
    order = list(reversed(range(12)))
    feed(1.0, [JOINT_NAMES[i] for i in order], [STAND[i] for i in order])
    np.testing.assert_array_equal(legs.controller.robot.joint_position, STAND)


@pytest.mark.usefixtures('alive')
def test_keys_change_the_state_that_is_published(feed, peer, spawn, spin_until):
    feed(1.0)
    spin_until(spawn.pump, lambda: peer.states == ['passive'])
    peer.press('2')
    stamps = iter(np.arange(1.002, 9.0, PERIOD).tolist())
    spin_until(
        spawn.pump,
        lambda: peer.states == ['passive', 'fixed stand'],
        step=lambda: feed(next(stamps)),
    )


@pytest.mark.usefixtures('alive')
def test_a_late_listener_still_learns_the_state(feed, spawn, spin_until):
    feed(1.0)
    late = spawn(Peer())
    spin_until(spawn.pump, lambda: late.states == ['passive'])


def test_an_illegal_key_is_explained_once(legs, peer, spawn, spin_until, capfd):
    for _ in range(3):
        peer.press('4')
    peer.press('Q')
    spin_until(spawn.pump, lambda: legs.notice.text.endswith("('Q' does nothing)"))
    said = capfd.readouterr().err
    assert said.count('trotting cannot follow passive') == 1
    assert said.count('press 2 to stand, then 4 to trot') == 1
    assert said.count("('Q' does nothing)") == 1
    assert legs.controller.state == 'passive'


def test_without_a_policy_its_key_names_the_parameter_that_gives_one(legs):
    said = legs.controller.press('p')
    assert said == 'start with -p policy:=FILE (there is no policy to play)'


def test_cmd_vel_needs_move_base_and_says_so_once(legs, peer, spawn, spin_until, capfd):
    for _ in range(3):
        peer.cmd_vel.publish(twist(0.5))
    spin_until(spawn.pump, lambda: legs.notice.text)
    said = legs.notice.text
    assert (
        said == 'press 2 to stand, then 5 for cmd_vel (cmd_vel drives in move base, not passive)'
    )
    assert capfd.readouterr().err.count(said) == 1
    np.testing.assert_array_equal(legs.controller.command_filter.command, 0.0)


@pytest.mark.usefixtures('alive')
def test_e_stop_lets_go_at_once(feed, peer, legs, spawn, spin_until):
    feed(1.0)
    peer.press('2')
    spin_until(spawn.pump, lambda: legs.controller._machine._due is not None)
    feed(1.002)
    feed(1.004)
    assert legs.controller.state == 'fixed stand'
    assert peer.e_stop.wait_for_service(PATIENCE)
    answer = peer.e_stop.call_async(Trigger.Request())
    spin_until(spawn.pump, answer.done)
    assert answer.result().success
    assert 'press 2' in answer.result().message
    assert legs.controller.state == 'passive'
    assert list(feed(1.006).points[1].positions) == [0.0] * 12


@pytest.mark.usefixtures('alive')
def test_odometry_is_published_50_times_a_second(feed, peer, spawn, spin_until):
    for index in range(101):
        feed(1.0 + PERIOD * index)
    spin_until(spawn.pump, lambda: len(peer.odometry) >= 10)
    assert len(peer.odometry) in (10, 11)
    message = peer.odometry[-1]
    assert (message.header.frame_id, message.child_frame_id) == ('odom', 'base')
    assert message.pose.pose.orientation.w == pytest.approx(1.0)
    assert 0.2 < message.pose.pose.position.z < 0.35
    assert (np.diag(np.array(message.pose.covariance).reshape(6, 6)) > 0.0).all()


@pytest.mark.usefixtures('alive')
def test_odometry_and_its_transform_have_one_stamp(feed, peer, node, spawn, spin_until):
    heard = []
    peer.create_subscription(tf_message_type(), '/tf', heard.append, 10)
    spin_until(spawn.pump, lambda: node._tf.available)
    for index in range(31):
        feed(1.0 + PERIOD * index)
    spin_until(spawn.pump, lambda: heard and peer.odometry)
    sent = [message.transforms[0].header.stamp for message in heard]
    assert peer.odometry[-1].header.stamp in sent


@pytest.mark.usefixtures('alive')
def test_a_clock_that_jumps_back_steps_nothing(feed, legs, readings):
    feed(5.0)
    answers = []
    readings.take_joints(2.0, JOINT_NAMES, RESTING, answers.append)
    assert readings.last == 2.0
    assert answers == []
    feed(2.002)  # and goes on from there
    assert legs.controller.state == 'passive'


@pytest.mark.usefixtures('alive')
def test_joints_may_change_their_order_on_the_way(feed, legs):
    feed(1.0)
    order = [3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8]
    positions = np.array(STAND) + 0.01 * np.arange(12)
    feed(1.002, [JOINT_NAMES[i] for i in order], positions[order])
    np.testing.assert_allclose(legs.controller.robot.joint_position, positions, atol=1e-12)


@pytest.mark.usefixtures('alive')
@pytest.mark.parametrize(
    ('names', 'joints'),
    [
        (('left_wheel_joint',), JointStates(*np.zeros((3, 1)))),
        (JOINT_NAMES, RESTING._replace(velocity=np.empty(0), effort=np.empty(0))),
        (JOINT_NAMES[:11], JointStates(*(part[:11] for part in RESTING))),
    ],
)
def test_a_state_that_is_not_complete_is_ignored_with_one_warning(
    readings, feed, names, joints, capfd
):
    answers = []
    for _ in range(2):
        readings.take_joints(0.95, names, joints, answers.append)
    feed(1.0)  # alive
    assert answers == []
    assert capfd.readouterr().err.count('joint_states lacks') == 1


@pytest.mark.usefixtures('alive')
def test_without_a_fresh_imu_it_gives_no_commands(readings, peer, feed, capfd):
    feed(1.0)
    answers = []
    for now in (1.5, 1.57):  # the first is given up when the next one comes
        readings.take_joints(now, JOINT_NAMES, RESTING, answers.append)
    assert 'imu/data is silent' in capfd.readouterr().err
    feed(1.602)
    assert answers == []
    assert len(peer.commands) == 2


@pytest.mark.usefixtures('alive')
@pytest.mark.parametrize('behind', [0.002, 1.0])
def test_joints_that_overtake_the_imu_wait_for_it(readings, feed, standing, behind):
    feed(1.0)
    answers = []
    readings.take_joints(1.0 + behind, JOINT_NAMES, RESTING, answers.append)
    assert readings.last == 1.0
    readings.take_imu(1.0 + behind, standing.imu)
    assert readings.last == 1.0 + behind
    assert len(answers) == 1


@pytest.mark.usefixtures('alive')
@pytest.mark.parametrize(('ago', 'counts'), [(5.0, False), (3.0, False), (0.1, True)])
def test_of_a_pause_of_the_simulator_a_velocity_counts_only_if_it_is_new(node, feed, ago, counts):
    feed(1.0)
    asked = node.legs.controller.command_filter
    asked.request(0.3, 0.0, 0.0)
    # The simulator is as if it had been paused.
    node.cmd_vel._steps._lived_at -= 4.2
    node.cmd_vel.came_at = time.monotonic() - ago
    feed(1.002)
    assert asked.is_silent == (not counts)


def test_legs_that_it_is_given_are_fed_by_no_topic(spawn, go2):
    legs = Legs(go2)
    node = spawn(LegControllerNode(legs))
    assert node.legs is legs
    assert node.count_publishers('joint_commands') == 0
    assert node.count_subscribers('joint_states') == 0
    assert node.count_subscribers('keys') == 1


def test_legs_that_it_is_given_take_its_parameters(spawn, go2):
    given = {'limits': 'guide', 'estimator': 'truth', 'update_rate': 400.0}
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    legs = spawn(LegControllerNode(Legs(go2), parameter_overrides=overrides)).legs
    assert legs.controller.command_filter.limits.forward == 0.4
    assert legs.controller._uses_truth
    assert legs.settings.update_rate == 400.0


def test_guides_limits_are_a_parameter(spawn):
    node = spawn(LegControllerNode(parameter_overrides=[Parameter('limits', value='guide')]))
    assert node.legs.controller.command_filter.limits.forward == 0.4


@pytest.mark.parametrize(
    ('override', 'message'),
    [
        ('description:=cat', 'cat: no such file'),
        ('description:=mbot', 'a quadruped is wanted'),
        ('estimator:=guess', 'estimator must be'),
        ('limits:=none', 'limits must be'),
        ('update_rate:=50.0', 'update_rate must be >= 300 and <= 1000 Hz, got 50.0'),
    ],
)
def test_as_a_process_it_says_what_is_wrong_in_one_line(isolated_ros, capsys, override, message):
    assert leg_controller(['--ros-args', '-p', override]) == 2
    said = capsys.readouterr().err
    rclpy.try_shutdown()
    assert re.match(rf'error: (\S+: )?{re.escape(message)}', said)
    assert said.count('\n') == 1


@pytest.mark.usefixtures('alive')
def test_what_was_said_goes_after_three_seconds_of_the_nodes_time(
    feed, peer, legs, spawn, spin_until
):
    feed(1.0)
    peer.press('w')
    spin_until(spawn.pump, lambda: legs.notice.text)
    assert legs.notice.text == 'press 2 to stand, then 4 to trot (w does nothing here)'
    stamps = iter(np.arange(1.002, 9.0, 0.01).tolist())
    spin_until(
        spawn.pump,
        lambda: not legs.notice.text,
        timeout=PATIENCE,
        step=lambda: feed(next(stamps)),
    )
    assert 3.9 < next(stamps) < 6.0


@pytest.mark.usefixtures('alive')
def test_a_legal_key_ends_what_was_said(feed, peer, legs, spawn, spin_until):
    feed(1.0)
    peer.press('w')
    spin_until(spawn.pump, lambda: legs.notice.text)
    peer.press('2')
    spin_until(spawn.pump, lambda: not legs.notice.text)


def test_sticks_do_not_outlive_the_keyboard_that_set_them(node, legs, peer, spawn, spin_until):
    other = Node('keyboard')
    keyboard = other.create_publisher(String, 'keys', 100)
    peer.destroy_publisher(peer.keys)
    legs.controller.press('w')
    spin_until(spawn.pump, lambda: node.count_publishers('keys') == 1)
    for _ in range(20):
        spawn.pump.handle(0.02)
    # As long as somebody could let go of them they stay.
    assert legs.controller.sticks.values.ly > 0.0
    other.destroy_publisher(keyboard)
    spin_until(spawn.pump, lambda: legs.controller.sticks.values.ly == 0.0)
    other.destroy_node()


@pytest.mark.usefixtures('alive')
@pytest.mark.parametrize('topic', ['joint_states', 'imu/data'])
def test_readings_that_come_too_slowly_move_nothing_and_are_said_once(
    feed, legs, readings, peer, spawn, spin_until, capfd, topic
):
    """50 Hz of either: what `ros2 run` of a simulator with another default would give."""
    (other,) = set(readings.feeds.by_topic) - {topic}
    readings.feeds.by_topic[other].wanted = 1.0  # content with any
    for index in range(60):
        feed(1.0 + 0.02 * index)
    said = f'{topic} comes at 50 Hz, wanted 500 (update_rate): it does not move'
    assert capfd.readouterr().err.count(said) == 1
    stamps = iter(np.arange(2.2, 12.0, 0.02).tolist())
    peer.press('2')
    spin_until(
        spawn.pump,
        lambda: legs.controller.state == 'fixed stand',
        step=lambda: feed(next(stamps)),
    )
    for _ in range(160):  # what was said is gone
        feed(next(stamps))
    peer.press('5')
    spin_until(spawn.pump, lambda: said in legs.notice.text, step=lambda: feed(next(stamps)))
    peer.cmd_vel.publish(twist(0.5))
    for _ in range(20):
        feed(next(stamps))
    assert legs.controller.state == 'fixed stand'
    assert capfd.readouterr().err.count(said) == 1  # to the key
    # It may move as soon as they come often enough.
    now = next(stamps)
    for index in range(60):
        feed(now + PERIOD * index)
    assert 'often enough again' in capfd.readouterr().err
    peer.press('5')
    stamps = iter(np.arange(now + 60 * PERIOD, 19.0, PERIOD).tolist())
    spin_until(
        spawn.pump,
        lambda: legs.controller.state == 'move base',
        step=lambda: feed(next(stamps)),
    )


@pytest.mark.usefixtures('alive')
def test_a_robot_whose_readings_ceased_for_a_while_is_passive(feed, legs, capfd):
    feed(1.0)
    legs.controller._machine.force(StateName.FIXED_STAND)
    feed(1.002)
    feed(1.002 + LONGEST_GAP + 0.01)
    assert legs.controller.state == 'passive'
    assert legs.controller.event == 'no joint_states for 0.3 s'


@pytest.mark.usefixtures('alive')
def test_odometry_has_the_stamp_of_its_reading_whatever_the_clock_of_the_node(
    feed, peer, spawn, spin_until
):
    """Without use_sim_time that clock is the wall's, decades away from the simulator's."""
    for index in range(21):
        feed(1.0 + PERIOD * index)
    spin_until(spawn.pump, lambda: peer.odometry)
    assert 1.0 <= seconds(peer.odometry[-1].header.stamp) <= 1.04


@pytest.mark.usefixtures('alive')
def test_states_that_are_lost_at_the_start_are_no_slow_stream(feed, legs, capfd):
    """Until it is answered for the first time, a simulator waits for nobody."""
    for index in range(10):
        feed(1.0 + 0.03 * index)
    for index in range(60):
        feed(1.3 + PERIOD * index)
    assert not legs.controller.hindrance
    assert capfd.readouterr().err == ''


@pytest.mark.usefixtures('alive')
def test_one_that_moves_is_stopped_as_soon_as_readings_come_slowly(feed, legs):
    for index in range(60):
        feed(1.0 + PERIOD * index)
    legs.controller._machine.force(StateName.BALANCE_TEST)
    for index in range(1, 8):
        feed(1.118 + 0.02 * index)
    assert legs.controller.state == 'fixed stand'
    assert legs.controller.hindrance
