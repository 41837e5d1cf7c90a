# SPDX-License-Identifier: Apache-2.0
"""`wasd topics`, `echo`, `hz`, `pub`, `call` and `params` against a robot in another process."""

from collections.abc import Callable, Iterator, Mapping
import os
import re
import select
import signal
import subprocess
import sys
import time
from types import SimpleNamespace
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
import programs
import pytest
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import String
from std_srvs.srv import Trigger
from terminals import PATIENCE, wait_until
from wasd_bringup.tools.graph import commands, ros_graph
from wasd_bringup.tools.graph.ros_graph import RosGraph
from wasd_core.network import claim, Run
import yaml

pytestmark = [pytest.mark.long, pytest.mark.slow]

WASD = (sys.executable, '-m', 'wasd_bringup.cli')
Ask = Callable[..., 'subprocess.CompletedProcess[str]']


def test_echo_hears_a_best_effort_publisher_and_ends_with_its_pipe(
    spawn: Any, new_runner: Any, spin_until: Any, isolated_ros: int
) -> None:
    import rclpy

    node = spawn(rclpy.create_node('talker'))
    publisher = node.create_publisher(String, 'chatter', qos_profile_sensor_data)
    process = new_runner(isolated_ros).start('echo', 'chatter', stdout=subprocess.PIPE)

    def has_said() -> bool:
        # Again and again: a subscriber that is found may not have found the publisher yet.
        publisher.publish(String(data='hello'))
        return bool(select.select([process.stdout], [], [], 0.0)[0])

    spin_until(spawn.pump, has_said)
    assert process.stdout.readline() == 'data: hello\n'
    process.stdout.close()

    def talk() -> bool:
        publisher.publish(String(data='again'))
        return process.poll() is not None

    spin_until(spawn.pump, talk)
    assert process.returncode == 0


@pytest.fixture
def ask_late(ros: None, new_runner: Any, isolated_ros: int) -> Iterator[Any]:
    """Return a function that starts `wasd` commands; they have begun to look, alone."""
    import rclpy

    processes: list[Any] = []

    def start(*commands: str) -> list[Any]:
        watcher, runner = rclpy.create_node('_watcher'), new_runner(isolated_ros)
        for text in commands:
            pipes = {'stdout': subprocess.PIPE, 'stderr': subprocess.PIPE}
            processes.append(runner.start(*text.split(), **pipes))
        wait_until(lambda: str(watcher.get_node_names()).count('_wasd_') == len(commands))
        watcher.destroy_node()
        return processes

    yield start
    for process in processes:
        process.kill()
        process.communicate()


def answer(process: Any, spawn: Any, spin_until: Any) -> str:
    """Start the node that the command looks for; return what the command says."""
    import rclpy

    spawn(rclpy.create_node('late_node'))
    spin_until(spawn.pump, lambda: process.poll() is not None)
    said, errors = process.communicate()
    assert process.returncode == 0, errors
    return str(said)


def test_params_waits_while_a_robot_appears_piece_by_piece(
    ask_late: Any, spawn: Any, spin_until: Any
) -> None:
    import rclpy

    (process,) = ask_late('params late_node')
    for number in range(3):
        spawn(rclpy.create_node(f'piece_{number}'))
        time.sleep(1.8)
    assert '  use_sim_time\n' in answer(process, spawn, spin_until)


def test_params_and_topics_wait_for_each_run_that_they_know_to_be_there(
    ask_late: Any, isolated_ros: int, spawn: Any, spin_until: Any
) -> None:
    import rclpy

    other = spawn(rclpy.create_node('of_another_run'))
    with claim(isolated_ros, ['/']):
        params, topics = ask_late('params late_node', 'topics')
        # Without one params would have given up, and the list of the other run been complete.
        time.sleep(6.0)
        assert params.poll() is None, params.communicate()[1]
        other.create_publisher(String, 'late', 1)
        other.create_publisher(DiagnosticStatus, 'driver', 1)
        assert '  use_sim_time\n' in answer(params, spawn, spin_until)
        spin_until(spawn.pump, lambda: topics.poll() is not None)
    assert '/late\n' in topics.communicate()[0]


def test_other_commands_that_come_do_not_prolong_the_wait_for_a_name(isolated_ros: int) -> None:
    import rclpy

    others: list[Any] = []

    def look() -> None:
        if len(others) < 50:
            others.append(rclpy.create_node(f'_wasd_{len(others)}'))

    with RosGraph() as graph:
        assert graph.wait(look, patience=0.5) is None
        for other in others:
            other.destroy_node()
    assert len(others) < 50


def test_a_node_that_never_answers_is_not_waited_for_without_end(
    isolated_ros: int, monkeypatch: Any, capsys: Any
) -> None:
    import rclpy

    monkeypatch.setattr(commands, 'LONGEST_CALL', 0.5)
    with RosGraph() as graph:
        node = rclpy.create_node('deaf')  # nobody handles its messages
        node.create_service(Trigger, 'deaf', lambda request, response: response)
        given = SimpleNamespace(service='deaf', rest=[])
        with pytest.raises(ros_graph.NotFound, match='no answer within 0.5 s; the request may'):
            commands.call(graph, given)
        node.destroy_node()
    assert capsys.readouterr().out.count('making request') == 1


def graph_that_sees(domain: int, drivers: Mapping[str, int]) -> Any:
    """Return a graph in a domain with such topics, each of a process by its number."""
    graph: Any = RosGraph()
    graph.node = SimpleNamespace(
        context=SimpleNamespace(get_domain_id=lambda: domain),
        get_topic_names_and_types=lambda: [(topic, ['']) for topic in drivers],
        get_publishers_info_by_topic=lambda topic: [
            SimpleNamespace(endpoint_gid=[*[drivers[topic]] * 12, *os.urandom(4)])
        ],
    )
    return graph


def test_two_robots_of_one_run_are_not_taken_for_two_runs(monkeypatch: Any) -> None:
    runs = [Run(3, 0, process) for process in (1, 2)]
    monkeypatch.setattr(ros_graph, 'running', lambda: runs)
    both = {'/go2/driver': 1, '/mbot/driver': 1}
    assert graph_that_sees(3, both)._is_expecting()
    # Three robots, and one that is in a namespace but has the root's clock.
    assert not graph_that_sees(3, {**both, '/x/driver': 2})._is_expecting()
    assert not graph_that_sees(3, {'/go2/driver': 1, '/mbot/driver': 2})._is_expecting()


def test_a_run_that_is_suspended_is_not_waited_for(isolated_ros: int) -> None:
    hold = f'from wasd_core.network import claim; held = claim({isolated_ros}, ["/"]); input()'
    graph = graph_that_sees(isolated_ros, {})
    with subprocess.Popen((sys.executable, '-c', hold), stdin=subprocess.PIPE) as process:
        wait_until(graph._is_expecting)
        process.send_signal(signal.SIGSTOP)
        wait_until(lambda: not graph._is_expecting())
        process.send_signal(signal.SIGCONT)
        wait_until(graph._is_expecting)


def test_where_no_node_runs_it_says_so_and_where_the_users_runs_are(
    new_runner: Any, isolated_ros: int
) -> None:
    runner, other = new_runner(), new_runner()
    said = 'no node runs in ROS domain {0.environment[ROS_DOMAIN_ID]}: '.format
    with claim(isolated_ros, ['/']):
        process = other.start('topics', stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        missed = programs.run_wasd(('echo', 'odom', '--once'), runner.folder, runner.environment)
        listed, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, listed) == (0, '/parameter_events\n')
    assert errors.startswith(said(other))
    assert missed.returncode == 1
    assert missed.stderr.startswith(f'error: no topic /odom; {said(runner)}')
    for text in (errors, missed.stderr):
        assert f' is in domain {isolated_ros}' in text


@pytest.fixture(scope='module')
def robot(new_runner: Any) -> Iterator[Any]:
    """
    A running mbot; yields the runner whose `wasd` commands see it.

    Slow, so that a robot that is only looked at takes little of a processor.
    """
    runner = new_runner()
    process = runner.start('mbot', '--viewer', 'none', '--speed', '0.25', '--duration', '600')
    yield runner
    process.terminate()
    process.wait(PATIENCE)


@pytest.fixture(scope='module')
def ask(robot: Any) -> Ask:
    """Return a function that runs `wasd` in a process of all; at first the robot is there."""

    def run(*words: str) -> 'subprocess.CompletedProcess[str]':
        return programs.run_wasd(words, robot.folder, robot.environment)

    wait_until(lambda: not run('echo', '--once', 'odom').returncode)
    return run


def test_topics_lists_every_topic_with_its_type(ask: Ask) -> None:
    lines: list[str] = []

    def are_listed() -> bool:
        lines[:] = ask('topics', '-t').stdout.splitlines()
        return len(lines) > 1

    wait_until(are_listed)
    assert '/joint_states [sensor_msgs/msg/JointState]' in lines
    assert '/clock [rosgraph_msgs/msg/Clock]' in lines
    assert lines == sorted(lines)
    assert not any('/_' in line for line in lines)


def test_echo_prints_a_message_as_yaml(ask: Ask) -> None:
    done = ask('echo', '--once', 'joint_states')
    assert done.returncode == 0
    assert done.stdout.endswith('\n---\n')
    (message, _) = yaml.safe_load_all(done.stdout)
    assert message['name'][:2] == ['left_wheel_joint', 'right_wheel_joint']
    assert len(message['position']) == len(message['name'])


def test_echo_gets_what_was_latched_before_it_came(ask: Ask) -> None:
    done = ask('echo', '--once', '--full-length', '--field', 'data', 'robot_description')
    assert done.stdout.startswith('<?xml')
    assert done.stdout.endswith('</robot>\n\n---\n')


def test_hz_measures_the_rate_until_ctrl_c(robot: Any, ask: Ask) -> None:
    process = robot.start('hz', '/odom', stdout=subprocess.PIPE)
    form = r'average rate: ([\d.]+)\n\tmin: [\d.]+s max: [\d.]+s std dev: [\d.]+s window: \d+\n'
    rates: list[float] = []
    deadline = time.monotonic() + PATIENCE
    try:
        # 50 Hz of a robot at a quarter of its speed.
        while pytest.approx(12.5, rel=0.3) not in rates:
            told = process.stdout.readline() + process.stdout.readline()
            found = re.fullmatch(form, told)
            assert found, told
            rates.append(float(found[1]))
            # On a busy machine a run makes up for what it was late with.
            assert time.monotonic() < deadline, rates
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0
    finally:
        process.kill()
        process.wait()


def test_call_pauses_the_simulation(ask: Ask) -> None:
    done = ask('call', '/simulator/pause', 'std_srvs/srv/SetBool', '{data: true}')
    # Without a type: it is looked up; and without the leading slash. Others need it running.
    go_on = ('call', 'simulator/pause', '{data: false}')
    wait_until(lambda: "message='running'" in ask(*go_on).stdout)
    waited = 'waiting for service to become available...\n'  # on a busy machine
    assert done.stdout.removeprefix(waited) == (
        'requester: making request: std_srvs.srv.SetBool_Request(data=True)\n\n'
        "response:\nstd_srvs.srv.SetBool_Response(success=True, message='paused')\n\n"
    )


def forward_speed(ask: Ask) -> float:
    """Return what odometry says of mbot's speed [m/s]."""
    done = ask('echo', '--once', '--field', 'twist.twist.linear.x', 'odom')
    return float(done.stdout.partition('\n')[0])


def test_pub_drives_until_ctrl_c(robot: Any, ask: Ask) -> None:
    # Without a type, which the topic has, and without the leading slash.
    words = ('pub', 'cmd_vel', '{linear: {x: 0.3}}', '--rate', '10')
    process = robot.start(*words, stdout=subprocess.PIPE)
    first = process.stdout.readline()
    assert first.startswith('publishing #1: geometry_msgs.msg.Twist(linear=')
    wait_until(lambda: abs(forward_speed(ask) - 0.3) <= 0.02)
    process.send_signal(signal.SIGINT)
    assert process.wait(PATIENCE) == 0
    # The drive's time-out, not the last message, stops it.
    wait_until(lambda: abs(forward_speed(ask)) <= 1e-3)


def test_pub_that_was_stopped_does_not_make_up_for_it(robot: Any) -> None:
    words = ('pub', 'nobody', 'std_msgs/String', '{data: hi}', '--rate', '200')
    began = time.monotonic()
    process = robot.start(*words, stdout=subprocess.PIPE)
    process.stdout.readline()
    process.send_signal(signal.SIGSTOP)
    time.sleep(1.5)
    process.send_signal(signal.SIGCONT)
    process.stdout.readline()
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    ran = time.monotonic() - began - 1.5
    said = process.communicate(timeout=PATIENCE)[0]
    assert process.returncode == 0
    # Made up for, there would be 300 more.
    assert said.count('publishing #') < 200.0 * ran + 150


def test_pub_sends_so_many_once_somebody_listens(robot: Any, ask: Ask) -> None:
    listener = robot.start('echo', 'told', 'std_msgs/String', stdout=subprocess.PIPE)
    words = ('pub', '/told', 'std_msgs/msg/String', '{data: hi}', '--times', '2', '--rate', '50')
    done = ask(*words)
    assert done.returncode == 0
    assert done.stdout.count('publishing #') == 2
    heard = [listener.stdout.readline() for _ in range(2)]
    listener.send_signal(signal.SIGINT)
    listener.wait(PATIENCE)
    assert heard == ['data: hi\n', '---\n']


def test_params_lists_gets_and_sets(ask: Ask) -> None:
    listed = ask('params', '/simulator').stdout.splitlines()
    assert '  state_rate' in listed
    assert listed == sorted(listed)
    assert ask('params', 'simulator', 'world').stdout == 'String value is: flat\n'
    assert ask('params', 'simulator', 'speed', '0.2').stdout == 'Set parameter successful\n'
    assert ask('params', 'simulator', 'speed').stdout == 'Double value is: 0.2\n'
    refused = ask('params', 'simulator', 'speed', '-1')
    assert (refused.returncode, refused.stdout) == (1, '')
    # The range is ROS' own, so that every tool shows it; then ROS says what is outside.
    assert 'Setting parameter failed: Parameter speed out of range' in refused.stderr
    assert refused.stderr.endswith('value: -1.0\n')


MISSING = {
    ('echo', '/odon'): 'no topic /odon, did you mean /odom?',
    ('pub', 'odom', '{}', '--once'): 'nobody listens to /odom as nav_msgs/msg/Odometry',
    ('call', '/simulator/paus'): 'no service /simulator/paus, did you mean /simulator/pause',
    ('params', '/simulater'): 'no node /simulater, did you mean /simulator?',
    ('params', 'get', 'simulator'): 'no node /get ... write params NODE [NAME [VALUE]]',
    ('params', 'simulator', 'sped', '1'): "no parameter 'sped', did you mean speed",
}


WRONG = {
    ('call', 'simulator/pause', '{data: 3}'): 'data: wanted boolean, got 3',
    ('call', 'simulator/pause', '{data: '): 'not YAML',
    ('call', 'simulator/pause', 'std_srvs/srv/Trigger'): 'is a std_srvs/srv/SetBool',
    ('echo', 'odom', 'nav_msgs/msg/Odometer'): "nav_msgs has no msg 'Odometer'",
    ('echo', 'odom', '--field', 'pose.pos'): '--field pose.pos',
    ('echo', 'not a name'): "'not a name'",
    ('hz', 'odom', '-w', '0'): '-w',
    ('pub', 'cmd_vel', '{linear: {q: 1}}'): "Vector3 has no field 'q'",
    ('pub', 'cmd_vel', '{linear: {x: fast}}'): "linear.x: wanted double, got 'fast'",
    ('pub', 'cmd_vel', 'forward'): "Twist: wanted fields as {name: value}, got 'forward'",
    ('pub', 'cmd_vel', '{}', '--rate', '0'): "--rate: got '0', wanted a number > 0",
}


@pytest.mark.parametrize(('cases', 'status'), [(MISSING, 1), (WRONG, 2)], ids=['missing', 'wrong'])
def test_what_is_missing_or_wrong_is_said_in_one_line(
    ask: Ask, robot: Any, cases: dict[tuple[str, ...], str], status: int
) -> None:
    answers = programs.run_wasd_together(cases, robot.folder, robot.environment)
    for (words, reason), done in zip(cases.items(), answers, strict=True):
        assert done.returncode == status, (words, done.stderr)
        assert len(done.stderr.splitlines()) == 1, done.stderr
        assert done.stderr.startswith('error: ')
        assert all(part in done.stderr for part in reason.split(' ... ')), done.stderr
