# SPDX-License-Identifier: Apache-2.0
import gc
import os
import signal
import subprocess
import sys
import threading
import time
from typing import ClassVar

from builtin_interfaces.msg import Time
import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import DescribeParameters
import rclpy
from rclpy.event_handler import EventHandler
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from terminals import PATIENCE, Stopwatch
from wasd_core.errors import UserError
from wasd_core.node import run_node
from wasd_core.parameters import InvalidParameter, parameter, Parameters
from wasd_core.ros_parameters import declare_parameters, misspelt_parameters
from wasd_core.signals import StopSignals

from wasd_core import node as node_support

pytestmark = pytest.mark.slow

SIM_TIME = Parameter('use_sim_time', value=True)


class Arm(Parameters):
    speed: float = parameter(1.0, doc='Speed', unit='m/s', above=0.0)
    share: float = parameter(0.5, doc='Share', minimum=0.0, maximum=1.0)
    mode: str = parameter('hold', doc='Mode', choices=('hold', 'latch'))
    frame: str = parameter('base', doc='Frame', read_only=True)


class ArmNode(Node):
    """A node with the parameters under test; remembers the sets it was told of."""

    def __init__(self, **overrides):
        super().__init__(
            'arm', parameter_overrides=[Parameter(k, value=v) for k, v in overrides.items()]
        )
        self.changes = []
        self.settings = declare_parameters(self, Arm, self.changes.append)

    def set(self, name, value):
        (result,) = self.set_parameters([Parameter(name, value=value)])
        return result


@pytest.fixture
def arm(spawn):
    return spawn(ArmNode())


def test_what_is_declared_is_the_definition(arm):
    assert arm.settings == Arm()
    assert arm.get_parameter('speed').value == 1.0


def test_whoever_is_told_of_changes_lives_as_long_as_the_node(spawn):
    class Tuner:
        changes: ClassVar[list[Arm]] = []

        def tune(self, changed):
            self.changes.append(changed)

    node = spawn(Node('tuned'))
    declare_parameters(node, Arm, Tuner().tune)
    gc.collect()
    node.set_parameters([Parameter('speed', value=2.0)])
    assert Tuner.changes == [Arm(speed=2.0)]


def test_what_is_given_at_start_counts(spawn):
    assert spawn(ArmNode(speed=3.0, mode='latch')).settings == Arm(speed=3.0, mode='latch')


@pytest.mark.parametrize(
    ('overrides', 'message'),
    [
        ({'speed': -1.0}, 'speed must be > 0 m/s, got -1.0'),
        ({'speed': float('nan')}, 'speed must be a finite number, got nan'),
        ({'speed': 'fast'}, "^arm: speed must be a number, got 'fast'"),
        ({'speed': True}, '^arm: speed must be a number, got True'),
        ({'speed': 0}, '^arm: speed must be > 0 m/s, got 0.0'),
        ({'share': 2}, '^arm: share must be >= 0 and <= 1, got 2.0'),
        ({'share': 2.0}, '^arm: share must be >= 0 and <= 1, got 2.0'),
        ({'mode': 2}, '^arm: .*mode'),
        ({'mode': 'drift'}, 'mode must be one of hold, latch'),
    ],
)
def test_an_illegal_value_at_start_is_an_error_of_one_line(ros, overrides, message):
    with pytest.raises(InvalidParameter, match=message) as caught:
        ArmNode(**overrides)
    assert '\n' not in str(caught.value)


def test_an_integer_is_taken_where_a_float_is_meant(spawn):
    node = spawn(ArmNode(speed=3, share=1))
    assert node.settings == Arm(speed=3.0, share=1.0)
    assert node.set('speed', 2).successful
    assert node.changes == [Arm(speed=2.0, share=1.0)]
    assert type(node.changes[0].speed) is float


def test_a_legal_change_is_told_with_the_whole_set(arm):
    assert arm.set('speed', 2.0).successful
    assert arm.set('mode', 'latch').successful
    assert arm.changes == [Arm(speed=2.0), Arm(speed=2.0, mode='latch')]


@pytest.mark.parametrize(
    ('name', 'value', 'reason'),
    [
        ('speed', -1.0, 'Parameter speed out of range'),  # ROS' own words
        ('speed', float('inf'), 'speed must be a finite number, got inf'),
        ('speed', -1, 'speed must be > 0 m/s, got -1.0'),
        ('speed', 'fast', "speed must be a number, got 'fast'"),
        ('speed', None, 'speed must be a number, got None'),
        ('share', 2, 'share must be >= 0 and <= 1, got 2.0'),
        ('mode', 'drift', "mode must be one of hold, latch, got 'drift'"),
        ('share', 1.5, 'share'),
        ('frame', 'odom', 'read-only'),
    ],
)
def test_an_illegal_change_is_rejected_with_the_reason(arm, name, value, reason):
    before = arm.get_parameter(name).value
    result = arm.set(name, value)
    assert not result.successful
    assert reason in result.reason
    assert arm.get_parameter(name).value == before
    assert arm.changes == []


def test_a_change_that_the_node_refuses_is_rejected_with_its_reason(spawn):
    class Picky(ArmNode):
        def __init__(self):
            Node.__init__(self, 'picky')
            self.settings = declare_parameters(self, Arm, self.refuse)

        def refuse(self, changed):
            raise InvalidParameter('not while moving')

    result = spawn(Picky()).set('speed', 2.0)
    assert (result.successful, result.reason) == (False, 'not while moving')


def test_parameters_describe_themselves(arm, spawn, spin_until):
    client = spawn(Node('asking')).create_client(DescribeParameters, 'arm/describe_parameters')
    spin_until(spawn.pump, client.service_is_ready)
    answer = client.call_async(DescribeParameters.Request(names=['speed', 'share', 'mode']))
    spin_until(spawn.pump, answer.done)
    speed, share, mode = answer.result().descriptors
    assert speed.description == 'Speed (float, > 0 m/s)'
    assert (share.floating_point_range[0].to_value, mode.additional_constraints) == (
        1.0,
        'hold, latch',
    )
    assert ParameterMessage(name='speed').name == speed.name
    (above,) = speed.floating_point_range  # an excluded end, and an open one
    assert 0.0 < above.from_value < 1e-300
    assert above.to_value == float('inf')


def test_a_first_signal_asks_for_a_stop():
    with StopSignals() as stop:
        assert not stop.requested
        os.kill(os.getpid(), signal.SIGTERM)
        assert stop.requested
    assert stop.exit_status == 128 + signal.SIGTERM


def test_ctrl_c_is_the_normal_way_to_leave_even_when_it_is_held_down():
    with StopSignals() as stop:
        for _ in range(5):
            os.kill(os.getpid(), signal.SIGINT)
        assert stop.requested
    # Nor when it still is while Python is left.
    os.kill(os.getpid(), signal.SIGINT)
    assert stop.exit_status == 0


def test_ctrl_c_later_cuts_a_shutdown_short_that_hangs(monkeypatch):
    monkeypatch.setattr(StopSignals, 'PATIENCE', 0.0)
    with StopSignals(), pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)


def test_the_handlers_that_were_there_come_back():
    before = [signal.getsignal(number) for number in StopSignals.WATCHED]
    with StopSignals():
        pass
    assert [signal.getsignal(number) for number in StopSignals.WATCHED] == before


def test_a_hang_up_stays_ignored_under_nohup():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with StopSignals() as stop:
            os.kill(os.getpid(), signal.SIGHUP)
            assert not stop.requested
    finally:
        signal.signal(signal.SIGHUP, before)


class Closing(Node):
    """A node that is told to stop as soon as it spins."""

    closed = False

    def __init__(self):
        super().__init__('closing')
        self.create_timer(0.01, lambda: os.kill(os.getpid(), signal.SIGTERM))

    def close(self):
        Closing.closed = rclpy.ok()


def test_a_node_is_closed_while_it_can_still_publish(isolated_ros):
    assert run_node(Closing, []) == 128 + signal.SIGTERM
    assert Closing.closed
    assert not rclpy.ok()


def test_what_is_wrong_at_start_is_one_line_and_status_2(isolated_ros, capsys):
    def fail():
        raise UserError('speed must be > 0')

    assert run_node(fail, []) == 2
    assert capsys.readouterr().err == 'error: speed must be > 0\n'
    assert not rclpy.ok()


BAD_ARGUMENTS = [
    (['-p', 'bad'], "ROS: Couldn't parse parameter override rule: '-p bad'"),
    (['-r', 'x'], "ROS: Couldn't parse remap rule: '-r x'"),
    (['--bogus'], "unknown ROS arguments: ['--bogus']"),
    (
        ['--params-file', 'nowhere.yaml'],
        "ROS: Couldn't parse params file: '--params-file nowhere.yaml': Error opening YAML file",
    ),
    (
        ['-p', 'use_sim_time:=1'],
        "ROS: Trying to set parameter 'use_sim_time' to '1' of type 'INTEGER', expecting type "
        "'BOOL': use_sim_time",
    ),
]


@pytest.mark.parametrize(('arguments', 'said'), BAD_ARGUMENTS)
def test_malformed_ros_arguments_are_one_line_and_status_2(isolated_ros, capfd, arguments, said):
    assert run_node(Closing, ['--ros-args', *arguments]) == 2
    assert capfd.readouterr().err == f'error: {said}\n'
    # The next start is not harmed, and rcl says again what it has to say.
    assert run_node(Closing, []) == 128 + signal.SIGTERM
    assert rclpy.logging.get_logger_effective_level('rcl') < rclpy.logging.LoggingSeverity.FATAL


def test_a_pipe_or_folder_of_parameters_is_refused_by_name(isolated_ros, capfd, tmp_path):
    os.mkfifo(tmp_path / 'pipe')
    (tmp_path / 'folder').mkdir()
    for kind in ('pipe', 'folder'):
        path = tmp_path / kind
        assert run_node(Closing, ['--ros-args', '--params-file', str(path)]) == 2
        said = f'error: --params-file {path}: is a {kind}, wanted a file\n'
        assert capfd.readouterr().err == said


def test_what_a_shell_substitutes_for_a_file_of_parameters_is_read(isolated_ros):
    reader, writer = os.pipe()
    os.write(writer, b'/**:\n  ros__parameters:\n    speed: 1.0\n')
    os.close(writer)
    words = ['--ros-args', '--params-file', f'/dev/fd/{reader}']
    assert run_node(Closing, words) == 128 + signal.SIGTERM


@pytest.mark.parametrize(
    ('name', 'said'),
    [('sped', "unknown parameter 'sped', did you mean speed?: ignored"), ('cargo', '')],
)
def test_a_misspelt_parameter_is_told_and_one_of_another_node_is_not(ros, name, said):
    class Driver(ArmNode):
        def __init__(self):
            super().__init__(**{name: 2.0, 'speed': 2.0})

    driver = Driver()
    assert misspelt_parameters(driver) == ([said] if said else [])
    driver.destroy_node()


def test_what_one_of_two_sets_of_a_node_refuses_changes_nothing_of_the_other(spawn):
    class Hand(Parameters):
        grip: float = parameter(1.0, doc='Grip', minimum=0.0)

    node, other = spawn(ArmNode()), []
    declare_parameters(node, Hand, other.append)
    for changes in ({'speed': 0.5, 'grip': -1.0}, {'speed': -1.0, 'grip': 0.5}):
        asked = [Parameter(name, value=value) for name, value in changes.items()]
        assert not node.set_parameters_atomically(asked).successful
    assert node.changes == other == []


def test_a_clock_below_zero_is_told_and_ends_no_node(spawn, spin_until, capfd):
    node, peer = spawn(Node('driver', parameter_overrides=[SIM_TIME])), spawn(Node('peer'))
    clock, said = peer.create_publisher(Clock, '/clock', 1), []

    def tell(second):
        clock.publish(Clock(clock=Time(sec=second)))
        said.append(capfd.readouterr().err)

    spin_until(spawn.pump, lambda: 'clock' in ''.join(said), step=lambda: tell(-5))
    assert '/clock: Seconds value must not be negative: ignored' in ''.join(said)
    said.clear()
    for _ in range(5):
        tell(-5)
        spawn.pump.handle(0.01)
    assert 'clock' not in ''.join(said)  # for 5 s once is enough
    now = node.get_clock().now
    spin_until(spawn.pump, lambda: now().nanoseconds == 7 * 10**9, step=lambda: tell(7))


def test_the_pump_handles_what_is_there_and_returns(spawn, spin_until):
    node = spawn(Node('talker'))
    received = []
    node.create_subscription(String, 'words', lambda m: received.append(m.data), 1000)
    publisher = node.create_publisher(String, 'words', 1000)
    spin_until(spawn.pump, lambda: publisher.get_subscription_count() > 0)
    for index in range(150):
        publisher.publish(String(data=str(index)))
    spin_until(spawn.pump, lambda: len(received) == 150)
    assert received == [str(index) for index in range(150)]
    stopwatch = Stopwatch(os.getpid())
    spawn.pump.handle()
    assert stopwatch.took(time.time()) < 1.0  # nothing more comes, and it does not wait


def test_a_flood_does_not_keep_the_pump_busy(spawn, monkeypatch):
    monkeypatch.setattr(node_support.MessagePump, 'LIMIT', 5)
    node = spawn(Node('flooded'))
    runs = []
    guard = node.create_guard_condition(lambda: (runs.append(1), guard.trigger()))
    guard.trigger()
    spawn.pump.handle(0.1)
    assert len(runs) <= 5


def test_the_pump_waits_also_for_a_node_with_a_guard(spawn, monkeypatch):
    node, waits = spawn(Node('guarded')), []
    guard = node.create_guard_condition(lambda: None)
    spawn.pump.handle()
    wait_for = spawn.pump.wait_for_ready_callbacks

    def note(timeout_sec=None):
        waits.append(timeout_sec)
        return wait_for(timeout_sec=timeout_sec)

    monkeypatch.setattr(spawn.pump, 'wait_for_ready_callbacks', note)
    spawn.pump.handle(0.05)
    assert waits == [0.05]
    guard.trigger()
    spawn.pump.handle(PATIENCE)  # and the guard ends the wait
    assert waits[1] == PATIENCE


def test_an_exception_in_a_handler_reaches_the_loop(spawn):
    node = spawn(Node('faulty'))

    def fail():
        raise RuntimeError('broken')

    node.create_guard_condition(fail).trigger()
    with pytest.raises(RuntimeError, match='broken'):
        for _ in range(10):
            spawn.pump.handle(0.1)


def test_events_of_quality_of_service_are_not_looked_at_with_each_message(spawn, monkeypatch):
    node, looks = spawn(Node('talker')), []
    node.create_publisher(String, 'words', 10)
    wait_for = EventHandler.add_to_wait_set
    monkeypatch.setattr(
        EventHandler, 'add_to_wait_set', lambda *args: (looks.append(1), wait_for(*args))
    )
    spawn.pump.handle()
    assert looks
    looks.clear()
    spawn.pump.handle()
    assert not looks
    monkeypatch.setattr(spawn.pump, 'EVENT_PERIOD', 0.0)
    spawn.pump.handle()
    assert looks


def test_a_topic_with_many_messages_does_not_make_the_pump_look_at_all_others(spawn, spin_until):
    node, heard, looked = spawn(Node('busy')), [], []
    node.create_subscription(String, 'words', heard.append, 100)
    quiet = node.create_subscription(String, 'silence', heard.append, 100)
    publisher = node.create_publisher(String, 'words', 100)
    spin_until(spawn.pump, publisher.get_subscription_count)
    for _ in range(9):
        publisher.publish(String(data='more'))
    time.sleep(0.2)  # all of them have arrived
    may = spawn.pump.can_execute
    spawn.pump.can_execute = lambda entity: bool(may(entity) and (looked.append(entity) or True))
    spawn.pump.handle()
    assert len(heard) == 9
    assert looked.count(quiet) == 1


def test_what_a_node_gets_and_loses_between_two_looks_is_heard_and_harms_nothing(
    spawn, spin_until
):
    node, heard = spawn(Node('changing')), []
    spawn.pump.handle()
    for topic in ('first', 'second'):
        subscription = node.create_subscription(String, topic, heard.append, 10)
        publisher = node.create_publisher(String, topic, 10)
        spin_until(spawn.pump, publisher.get_subscription_count)
        publisher.publish(String(data=topic))
        spin_until(spawn.pump, lambda topic=topic: [m.data for m in heard] == [topic])
        heard.clear()
        node.destroy_subscription(subscription)
        spawn.pump.handle()
    ticks = []
    timer = node.create_timer(0.01, lambda: ticks.append(1))
    spin_until(spawn.pump, lambda: len(ticks) > 2)
    timer.destroy()  # nobody is told
    spawn.pump.handle()
    future = spawn.pump.create_task(lambda: 'done')
    spawn.pump.handle()
    assert future.result() == 'done'


def test_a_pump_waits_for_what_comes_within_the_time_and_no_longer(spawn, spin_until):
    node, heard = spawn(Node('waiting')), []
    node.create_subscription(String, 'words', lambda m: heard.append(time.monotonic()), 10)
    publisher = node.create_publisher(String, 'words', 10)
    spin_until(spawn.pump, publisher.get_subscription_count)
    sender = threading.Timer(0.1, publisher.publish, [String(data='late')])
    started = time.monotonic()
    sender.start()
    for _ in range(10):  # more may come than this message
        spawn.pump.handle(60.0)
        if heard:
            break
    sender.join()
    assert heard
    assert time.monotonic() - started < 50.0  # it was woken


def test_all_messages_that_wait_are_handled_in_one_go(spawn, spin_until):
    node = spawn(Node('busy'))
    heard = []
    node.create_subscription(String, 'words', heard.append, 100)
    publisher = node.create_publisher(String, 'words', 100)
    spin_until(spawn.pump, publisher.get_subscription_count)
    publisher.publish(String(data='first'))
    spin_until(spawn.pump, lambda: heard)
    for _ in range(30):
        publisher.publish(String(data='more'))
    time.sleep(0.2)  # all of them have arrived
    spawn.pump.handle(0.0)
    assert len(heard) == 31


def test_a_program_ends_where_the_middleware_does_not_let_go(tmp_path):
    program = tmp_path / 'stuck.py'
    program.write_text(
        """import ctypes

from rclpy.node import Node
from wasd_core import node, signals


class Stuck(Node):
    def close(self):
        print('closed', flush=True)

    def destroy_node(self):
        ctypes.PyDLL(None).sleep(600)  # with Python's lock, as Fast DDS does


signals.GOODBYE = 0.5
node.run_node(lambda: Stuck('stuck'), [], lambda made, stop: None)
"""
    )
    result = subprocess.run(
        [sys.executable, program], capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert (result.returncode, result.stdout, result.stderr) == (1, 'closed\n', '')
