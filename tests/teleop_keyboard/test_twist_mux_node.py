# SPDX-License-Identifier: Apache-2.0
"""`twist_mux` in this process; who sends to it and listens to it lives in another context."""

from geometry_msgs.msg import Twist, TwistStamped
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool, String
from teleop_keyboard.parameters import twist_mux
from teleop_keyboard.twist_mux_node import TwistMuxNode
from visualization_msgs.msg import Marker
from wasd_core.parameters import InvalidParameter

pytestmark = pytest.mark.slow


class Peer:
    """The rest of the robot: sends velocities and locks, hears what comes of it."""

    def __init__(self, context, output_type):
        self.node = rclpy.create_node('peer', context=context)
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.node)
        self.out, self.selected, self.markers = [], [], []
        latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        create = self.node.create_subscription
        create(output_type, 'cmd_vel_out', self.out.append, 100)
        create(String, 'selected', lambda m: self.selected.append(m.data), latched)
        create(Marker, 'twist_marker', self.markers.append, 10)

    def publisher(self, message_type, topic):
        return self.node.create_publisher(message_type, topic, 10)

    def speeds(self):
        twists = [getattr(message, 'twist', message) for message in self.out]
        return [twist.linear.x for twist in twists]


@pytest.fixture
def peer_of(context):
    peers = []

    def make(output_type=Twist):
        peers.append(Peer(context, output_type))
        return peers[-1]

    yield make
    for peer in peers:
        peer.executor.shutdown()
        peer.node.destroy_node()


@pytest.fixture
def mux(ros_domain, spawn):
    return spawn(TwistMuxNode())


@pytest.fixture
def run_until(spawn, spin_until):
    def run(condition, peer, step=None):
        def both():
            if step is not None:
                step()
            peer.executor.spin_once(timeout_sec=0.005)

        spin_until(spawn.pump, condition, step=both)

    return run


def stamped(x):
    message = TwistStamped()
    message.twist.linear.x = x
    return message


def plain(x):
    message = Twist()
    message.linear.x = x
    return message


def test_sources_are_relayed_and_a_loss_ends_in_one_zero(mux, peer_of, run_until):
    peer = peer_of()
    keyboard, joystick = peer.publisher(Twist, 'key_vel'), peer.publisher(Twist, 'joy_vel')
    run_until(lambda: 0.1 in peer.speeds(), peer, lambda: keyboard.publish(plain(0.1)))
    assert mux.mux.selected == 'keyboard'
    run_until(lambda: 0.2 in peer.speeds(), peer, lambda: joystick.publish(plain(0.2)))
    assert mux.mux.selected == 'joystick'
    run_until(lambda: mux.mux.selected == '', peer)
    run_until(lambda: peer.selected[-1:] == [''] and 0.0 in peer.speeds(), peer)
    assert [name for name in peer.selected if name] == ['keyboard', 'joystick']
    assert peer.speeds().count(0.0) == 1
    assert peer.speeds()[-1] == 0.0
    assert peer.markers[-1].type == Marker.ARROW
    assert peer.markers[-1].header.frame_id == 'base_footprint'


def test_an_e_stop_stops_within_a_cycle_and_holds(mux, peer_of, run_until):
    peer = peer_of()
    keyboard, e_stop = peer.publisher(Twist, 'key_vel'), peer.publisher(Bool, 'e_stop')
    run_until(lambda: 0.1 in peer.speeds(), peer, lambda: keyboard.publish(plain(0.1)))
    run_until(lambda: mux.mux._closed.get('e_stop'), peer, lambda: e_stop.publish(Bool(data=True)))
    run_until(lambda: peer.speeds()[-1] == 0.0, peer)
    count = len(peer.out)
    sent = []
    run_until(lambda: len(sent) > 30, peer, lambda: sent.append(keyboard.publish(plain(0.3))))
    assert len(peer.out) == count
    e_stop.publish(Bool(data=False))
    run_until(lambda: 0.3 in peer.speeds(), peer, lambda: keyboard.publish(plain(0.3)))


def test_a_lock_is_a_zero_in_the_same_instant(mux):
    sent = []
    mux.output.receivers.append(lambda message: sent.append(message.linear.x))
    mux._on_twist('keyboard', plain(0.1))
    mux._on_lock('pause', Bool(data=True))
    assert sent == [0.1, 0.0]
    mux.step()
    assert sent == [0.1, 0.0]


def test_the_default_tables_are_twist_muxs_and_can_be_read(mux):
    names = {name for name in mux._parameters if name.startswith(('topics.', 'locks.'))}
    rows = {name.rpartition('.')[0] for name in names}
    assert rows == {
        *(f'topics.{name}' for name in ('navigation', 'keyboard', 'joystick', 'tablet')),
        *(f'locks.{name}' for name in ('pause', 'loop_closure', 'joystick', 'e_stop')),
    }
    assert mux.get_parameter('topics.keyboard.topic').value == 'key_vel'
    assert mux.get_parameter('topics.keyboard.timeout').value == 0.5
    assert mux.get_parameter('topics.keyboard.priority').value == 90


def test_stamped_it_takes_and_sends_stamped_velocities(ros_domain, spawn, peer_of, run_until):
    spawn(TwistMuxNode(parameter_overrides=[Parameter('stamped', value=True)]))
    peer = peer_of(TwistStamped)
    keyboard = peer.publisher(TwistStamped, 'key_vel')
    run_until(lambda: 0.1 in peer.speeds(), peer, lambda: keyboard.publish(stamped(0.1)))
    assert peer.out[-1].header.frame_id == 'base_footprint'
    assert peer.out[-1].header.stamp.sec > 0


def test_a_velocity_that_is_no_number_is_not_relayed(mux):
    relayed = []
    mux.output.receivers.append(relayed.append)
    mux._on_twist('keyboard', plain(float('nan')))
    assert relayed == []
    assert mux.mux.selected == ''


def test_tables_are_twist_muxs_parameters(spawn):
    node = spawn(
        TwistMuxNode(
            parameter_overrides=[
                Parameter('topics.web.topic', value='web_vel'),
                Parameter('topics.web.timeout', value=1),
                Parameter('topics.web.priority', value=20),
                Parameter('topics.nav.topic', value='nav_cmd'),
                Parameter('topics.nav.priority', value=10),
            ]
        )
    )
    assert node.get_parameter('topics.web.timeout').value == 1
    assert node.mux.offer('nav', 0.0)
    assert node.mux.offer('web', 0.0)
    (result,) = node.set_parameters([Parameter('topics.nav.priority', value=30)])
    assert result.successful
    assert node.mux.offer('nav', 0.1)
    (result,) = node.set_parameters([Parameter('topics.nav.priority', value=300)])
    assert not result.successful
    assert 'nav.priority must be >= 0 and <= 255, got 300' in result.reason
    (result,) = node.set_parameters([Parameter('topics.nav.topic', value='other')])
    assert not result.successful


def test_a_wrong_table_is_named(spawn):
    with pytest.raises(InvalidParameter, match=r'web.priority must be a whole number, got 1\.5'):
        TwistMuxNode(
            parameter_overrides=[
                Parameter('topics.web.topic', value='web_vel'),
                Parameter('topics.web.priority', value=1.5),
            ]
        )


@pytest.mark.parametrize(
    ('topic', 'said'),
    [
        (
            'key-vel',
            'Invalid topic name: topic name must not contain characters other than alphanumerics, '
            "'_', '~', '{', or '}': 'key-vel'",
        ),
        (
            '7',
            "Trying to set parameter 'topics.keyboard.topic' to '7' of type 'INTEGER', expecting "
            "type 'STRING': topics.keyboard.topic",
        ),
    ],
)
def test_a_topic_that_is_none_is_one_line(isolated_ros, capfd, topic, said):
    assert twist_mux(['--ros-args', '-p', f'topics.keyboard.topic:={topic}']) == 2
    assert capfd.readouterr().err == f'error: ROS: {said}\n'
