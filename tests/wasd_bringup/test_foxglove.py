# SPDX-License-Identifier: Apache-2.0
"""`--foxglove`: a client gets every topic with its definition, drives, and stops by silence."""

import math
import subprocess
import sys
import time

from cases import for_all
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from terminals import PATIENCE
from wasd_bringup.run.options import RunOptions
from wasd_bringup.tools.recording.reader import BagReader
from wasd_bringup.tools.recording.recorder import BagRecorder, full_definition
from wasd_core.errors import UserError
from wasd_core.topics import FOLLOWED
from websockets.exceptions import InvalidStatus

pytest.importorskip('foxglove.websocket', reason="the extra 'foxglove' is not installed")
from foxglove_client import FoxgloveClient  # noqa: E402
from wasd_bringup.ros.face import make_ros_run  # noqa: E402
from wasd_bringup.ros.foxglove import FoxgloveServer  # noqa: E402

pytestmark = pytest.mark.slow

TWIST = 'geometry_msgs/msg/Twist'
KEY = 'std_msgs/msg/String'


class Run:
    """mbot with a server and a client; simulated time passes when it is told to."""

    def __init__(self, recorder=None, preset='mbot'):
        self.server = FoxgloveServer(0)
        options = RunOptions(robot='mbot', description='mbot', preset=preset, speed=0.0)
        self.session = make_ros_run(options, recorder=recorder, foxglove=self.server)
        self.client = FoxgloveClient(self.server.port)

    def step(self, seconds, act=lambda: None):
        """Let time pass as in a run, and `act` every 20 ms of it."""
        for _ in range(round(seconds / 0.02)):
            act()
            self.session.simulation.advance(20)
            self.look()

    def look(self):
        self.session._poll(0.0)
        self.client.take()

    def wait_until(self, condition, act=lambda: None):
        """Let time pass until what a client or the server's threads do is done."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline
            self.step(0.02, act)
            time.sleep(0.001)

    @property
    def target(self):
        """The velocity ahead that the robot is to have [m/s]."""
        return self.session.robot.drive_unit.controller.target.linear

    @property
    def speed(self):
        """The velocity ahead that it has [m/s]."""
        return float(self.session.world.base().planar_velocity[0])

    @property
    def publishers(self):
        """Topic -> type of all that is published."""
        return {
            publisher.topic_name: publisher.msg_type
            for node in self.session.face.nodes
            for publisher in node.publishers
        }

    def close(self):
        self.client.close()
        self.session.close()
        self.server.shut_down()


@pytest.fixture
def run(ros):
    run = Run()
    run.wait_until(lambda: len(run.client.channels) >= len(run.publishers) - 1)
    yield run
    run.close()


def forward(run, speed=0.2):
    """A function that publishes a velocity."""
    message = Twist()
    message.linear.x = speed
    return lambda: run.client.publish('/cmd_vel', TWIST, serialize_message(message))


def test_every_topic_has_its_definition_and_its_messages_come(run):
    topics = run.publishers.keys() - {'/parameter_events'}
    assert topics >= {'/odom', '/clock', '/joint_states', '/keys', '/cmd_vel'}
    assert run.client.channels.keys() == topics
    for channel in run.client.channels.values():
        assert (channel['encoding'], channel['schemaEncoding']) == ('cdr', 'ros2msg')
        assert channel['schema'] == full_definition(channel['schemaName'])
    run.client.subscribe(*topics)
    always = {'/odom', '/clock', '/joint_states', '/ground_truth/odom', '/robot_description'}
    run.wait_until(lambda: always <= run.client.messages.keys())
    drive = forward(run)

    def act():
        # Again and again: the first picture may take so long that what waited is not taken.
        drive()
        run.client.publish('/keys', KEY, serialize_message(String(data='k')))

    run.wait_until(lambda: {'/keys', '/cmd_vel'} <= run.client.messages.keys(), act)
    for topic, found in run.client.messages.items():
        for data in found:
            deserialize_message(data, run.publishers[topic])
    assert deserialize_message(run.client.messages['/robot_description'][-1], String).data
    times = [deserialize_message(data, Clock).clock for data in run.client.messages['/clock']]
    assert [(t.sec, t.nanosec) for t in times] == sorted((t.sec, t.nanosec) for t in times)
    run.wait_until(lambda: run.client.time > 0)
    assert run.client.time <= run.session.world.time * 1e9 + 1


def test_only_what_somebody_follows_is_made(run):
    assert set() == FOLLOWED
    run.client.subscribe('/odom')
    run.wait_until(lambda: '/odom' in run.client.messages)
    assert {'/odom'} == FOLLOWED
    run.step(0.2)
    assert run.client.messages.keys() == {'/odom'}
    run.client.vanish()
    run.client = FoxgloveClient(run.server.port)
    run.wait_until(lambda: not FOLLOWED)


@pytest.mark.parametrize('encoding', ['cdr', 'json'])
def test_a_client_drives_mbot_and_its_silence_stops_it(run, encoding):
    fields = {'linear': {'x': 0.2, 'y': 0, 'z': 0}, 'angular': {'x': 0, 'y': 0, 'z': 0.0}}
    by_json = lambda: run.client.publish('/cmd_vel', 'geometry_msgs/Twist', fields)  # noqa: E731
    act = forward(run) if encoding == 'cdr' else by_json
    run.client.subscribe('/odom')

    def told():
        """Return the speed that the client was last told, which is a while on its way [m/s]."""
        sent = run.client.messages.get('/odom', [])
        return deserialize_message(sent[-1], Odometry).twist.twist.linear.x if sent else 0.0

    run.wait_until(lambda: run.speed > 0.19 and told() > 0.1, act)
    # What is on its way still comes; then nothing does, and its watchdog needs 0.5 s.
    run.wait_until(lambda: run.target == 0.0)
    run.step(1.0)
    assert run.speed == pytest.approx(0.0, abs=1e-3)


@pytest.fixture
def patient(monkeypatch):
    """No client's silence stops a robot while a test lasts."""
    monkeypatch.setattr('wasd_bringup.ros.foxglove_inbox.SILENCE', 1e6)


def velocities_of(run, monkeypatch):
    """Return a list that gets what mbot is commanded: its own watchdog stops it without a word."""
    commanded, drive = [], run.session.robot.command
    monkeypatch.setattr(
        run.session.robot,
        'command',
        lambda velocity: (commanded.append(velocity), drive(velocity)),
    )
    return commanded


def test_a_client_that_is_gone_stops_mbot(run, patient, monkeypatch):
    commanded = velocities_of(run, monkeypatch)
    run.wait_until(lambda: run.target > 0.19, forward(run))
    run.client.vanish()
    run.client = FoxgloveClient(run.server.port)
    run.wait_until(lambda: commanded[-1] == (0.0, 0.0, 0.0))
    assert run.target == 0.0


def test_a_key_drives_and_its_client_gone_does_no_more(ros, patient):
    run = Run(preset='ramps')  # a key's velocity lasts until another key
    key = String(data='w')
    run.client.publish('/keys', KEY, serialize_message(key))
    run.wait_until(lambda: run.target > 0.0)
    run.step(2.0)
    assert run.target > 0.0
    run.client.vanish()
    run.client = FoxgloveClient(run.server.port)
    run.wait_until(lambda: run.target == 0.0)
    run.close()


def test_halted_the_last_word_on_cmd_vel_is_zero_and_a_client_that_goes_on_moves_nothing(
    run, patient, monkeypatch
):
    commanded = velocities_of(run, monkeypatch)
    run.wait_until(lambda: run.target > 0.19, forward(run))
    run.session.stop()
    assert commanded[-1] == (0.0, 0.0, 0.0)
    count = len(commanded)
    run.wait_until(lambda: run.client.complaints, forward(run))
    assert run.client.complaints[-1].startswith('/cmd_vel: stopped; to drive again send a zero')
    assert not any(any(velocity) for velocity in commanded[count:])


def test_a_topic_without_a_definition_is_looked_for_once_and_not_made(ros, monkeypatch):
    asked = []

    def without_odometry(kind):
        asked.append(kind)
        if kind == 'nav_msgs/msg/Odometry':
            raise UserError('its package came without definitions')
        return full_definition(kind)

    monkeypatch.setattr('wasd_bringup.ros.foxglove.full_definition', without_odometry)
    run = Run()
    nodes = run.session.face.nodes
    topics = [p for node in nodes for p in node.publishers if p.topic_name == '/odom']
    assert [publisher.get_subscription_count() for publisher in topics] == [1]
    for _ in range(2):
        run.server.offer(nodes)
    odometries = [topic for topic, kind in run.publishers.items() if kind is Odometry]
    assert asked.count('nav_msgs/msg/Odometry') == len(odometries)
    assert [publisher.get_subscription_count() for publisher in topics] == [0]
    run.close()


@for_all(
    ('topic', 'schema', 'data', 'words'),
    [
        ('/cmd_vel', TWIST, b'\0\1\0\0\1', '/cmd_vel: '),
        ('/cmd_vel', TWIST, b'', '/cmd_vel: '),
        (
            '/cmd_vel',
            'std_msgs/msg/String',
            b'\0\1\0\0',
            '/cmd_vel: got std_msgs/msg/String, wanted',
        ),
        ('/cmd_vel', TWIST, {'linear': {'q': 1}}, "/cmd_vel: Vector3 has no field 'q'"),
        ('/cmd_vel', TWIST, {'linear': {'x': 'fast'}}, '/cmd_vel: linear.x: wanted double'),
        ('/cmd_vel', TWIST, {'angular': {'z': math.nan}}, '/cmd_vel: a velocity that is not fin'),
        (
            '/cmd_vel',
            TWIST,
            {'linear': {'x': math.inf}},
            '/cmd_vel: a velocity that is not finite',
        ),
        ('/odom', TWIST, {}, '/odom: clients cannot publish there; wanted /cmd_vel or /keys'),
        ('/keys', KEY, {'data': '\ud800'}, '/keys: data: wanted text of whole characters, got'),
    ],
)
def test_what_is_no_command_moves_nothing_and_its_sender_reads_why(
    run, topic, schema, data, words
):
    run.client.complaints.clear()
    run.client.publish(topic, schema, data)
    run.wait_until(lambda: run.client.complaints)
    assert run.client.complaints[-1].startswith(words)
    assert run.target == 0.0


def test_a_recording_and_foxglove_hear_the_same_and_the_recording_all_of_it(ros, tmp_path):
    recorder = BagRecorder(tmp_path / 'run.mcap', {})
    run = Run(recorder)
    heard, topics = run.client.messages, {'/odom', '/joint_states'}
    run.wait_until(lambda: topics <= run.client.channels.keys())
    run.client.subscribe(*topics)
    run.wait_until(lambda: all(len(heard.get(topic, ())) >= 10 for topic in topics))
    steps = round(run.session.world.time / 0.02)
    run.close()
    recorder.close()
    recorded = BagReader(tmp_path / 'run.mcap')
    for topic in topics:
        data = [message.data for message in recorded.messages([topic])]
        first = data.index(heard[topic][0])
        assert data[first : first + len(heard[topic])] == heard[topic]

    alone = BagRecorder(tmp_path / 'alone.mcap', {})
    session = make_ros_run(
        RunOptions(robot='mbot', description='mbot', preset='mbot', speed=0.0), recorder=alone
    )
    for _ in range(steps):
        session.simulation.advance(20)
        session._poll(0.0)
    session.close()
    alone.close()
    assert recorded.topics == BagReader(tmp_path / 'alone.mcap').topics


def test_who_comes_late_gets_what_is_latched_and_who_is_there_does_not_get_it_again(run):
    late = FoxgloveClient(run.server.port)
    for client in (run.client, late):
        run.wait_until(lambda client=client: '/robot_description' in client.channels, late.take)
        client.subscribe('/robot_description')
        run.wait_until(lambda client=client: client.messages.get('/robot_description'), late.take)
    run.step(0.1, late.take)
    assert [len(c.messages['/robot_description']) for c in (run.client, late)] == [1, 1]
    late.close()


def test_a_port_that_is_taken_is_said(ros):
    server = FoxgloveServer(0)
    try:
        with pytest.raises(
            UserError, match=rf'port {server.port} of 127.0.0.1: address already i'
        ):
            FoxgloveServer(server.port)
    finally:
        server.shut_down()


@for_all('origin', ['https://evil.example', 'null'])
def test_a_page_of_somebody_else_does_not_connect_and_is_said(run, origin):
    with pytest.raises(InvalidStatus, match='403'):
        FoxgloveClient(run.server.port, origin)
    said = []
    run.session.robots[0].say = said.append
    run.wait_until(lambda: said)
    assert said == [f'foxglove: a page of {origin} wants to drive: refused']


def test_the_app_of_foxglove_connects_and_the_library_itself_is_not_to_be_found(run):
    app = FoxgloveClient(run.server.port, 'https://app.foxglove.dev')
    run.wait_until(lambda: '/odom' in app.channels, app.take)
    app.close()
    with pytest.raises(ConnectionRefusedError):
        FoxgloveClient(run.server._server.port)


def test_warnings_of_ours_are_as_before_once_the_library_is_loaded(tmp_path):
    program = (
        'import logging, sys\n'
        'from wasd_bringup.ros.foxglove import load_sdk\n'
        'load_sdk()\n'
        f'sys.stderr = open({str(tmp_path / "said")!r}, "w")\n'
        'logging.getLogger("robot").warning("description: a mesh is missing")\n'
    )
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True)
    assert done.stderr == ''
    assert (tmp_path / 'said').read_text() == 'description: a mesh is missing\n'
