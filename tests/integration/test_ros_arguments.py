# SPDX-License-Identifier: Apache-2.0
"""Every node under a namespace, with parameters, a parameter file and a remapping."""

from collections.abc import Callable, Iterator
import importlib
import importlib.util
from pathlib import Path
import signal
import subprocess
import sys
from typing import Any

import programs
import pytest
from rcl_interfaces.srv import GetParameters
import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from robot_description.packages import description_path
from terminals import PATIENCE
from wasd_core.node import init_ros
import yaml

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
LATCHED = {'robot_description', 'selected', 'state', '/tf_static'}
LATCHED |= {'map', 'map_metadata', 'global_costmap/costmap', 'guard/state', 'keepout_filter_mask'}


class Case:
    """A node class, a parameter with another value than its default, and a topic to rename."""

    def __init__(self, node: str, parameter: str, value: Any, topic: str) -> None:
        self.module, _, self.kind = node.rpartition('.')
        self.parameter, self.value, self.topic = parameter, value, topic

    def make(self) -> Any:
        """Make the node as its process does, rclpy initialised."""
        return getattr(importlib.import_module(self.module), self.kind)()


CASES = {
    'diff_drive_controller': Case(
        'diff_drive_sim.diff_drive_controller_node.DiffDriveControllerNode',
        'linear.x.max_velocity', 0.4, 'cmd_vel',
    ),
    'gamepad': Case(
        'teleop_keyboard.gamepad_node.GamepadNode', 'deadzone', 0.2, 'cmd_vel'
    ),
    'guard': Case(
        'wasd_navigation.guard_node.GuardNode',
        'FootprintApproach.time_before_collision', 0.5, 'scan'
    ),
    'key_publisher': Case(
        'teleop_keyboard.key_publisher_node.KeyPublisherNode', 'raw', True, 'keys'
    ),
    'keys_to_twist': Case(
        'teleop_keyboard.keys_to_twist_node.KeysToTwistNode', 'speed', 0.25, 'cmd_vel'
    ),
    'leg_controller': Case(
        'quadruped_sim.leg_controller_node.LegControllerNode', 'limits', 'guide', 'cmd_vel'
    ),
    'navigator': Case(
        'wasd_navigation.navigator_node.NavigatorNode', 'limits.forward', 0.3, 'goal_pose'
    ),
    'policy_player': Case(
        'policy_player.policy_player_node.PolicyPlayerNode',
        'description', str(description_path('g1')), 'keys',
    ),
    'simulator': Case(
        'mujoco_sim.simulator_node.SimulatorNode', 'seed', 7, 'joint_states'
    ),
    'state_publisher': Case(
        'robot_description.state_publisher_node.StatePublisherNode',
        'description', 'go2', 'robot_description',
    ),
    'twist_mux': Case(
        'teleop_keyboard.twist_mux_node.TwistMuxNode', 'frame_id', 'base', 'cmd_vel_out'
    ),
}  # fmt: skip


@pytest.fixture
def node_of(isolated_ros: int) -> Iterator[Callable[..., Any]]:
    """Return `node_of(name, *arguments)`: a node with `--ros-args arguments`."""
    made = []

    def make(name: str, *arguments: str) -> Any:
        init_ros(['--ros-args', *arguments])
        made.append(CASES[name].make())
        return made[-1]

    yield make
    for node in made:
        node.destroy_node()
    rclpy.try_shutdown()


def topics(node: Any) -> set[str]:
    """Return all topics of a node but rclpy's own."""
    names = {end.topic_name for end in (*node.publishers, *node.subscriptions)}
    return {name for name in names if 'rosout' not in name and 'parameter_events' not in name}


def test_the_table_has_every_node_of_a_package_with_a_parameter_file():
    # Those of wasd_bringup are for its launch files.
    paths = set(ROOT.glob('*/config/*.yaml')) - set(ROOT.glob('wasd_bringup/config/*.yaml'))
    assert set(CASES) == {path.stem for path in paths}


@pytest.mark.parametrize('name', CASES)
def test_a_node_takes_a_namespace_a_remapping_and_parameters(name, node_of):
    case = CASES[name]
    word = f'{case.parameter}:={yaml.safe_dump(case.value).splitlines()[0]}'
    words = ('-r', f'{case.topic}:=somewhere/else', '-p', word, '-p', 'use_sim_time:=true')
    node = node_of(name, '-r', '__ns:=/field/robot', *words)
    assert node.get_fully_qualified_name() == f'/field/robot/{name}'
    # A namespace prefixes every topic but these.
    outside = {topic for topic in topics(node) if not topic.startswith('/field/robot/')}
    assert outside <= {'/clock', '/diagnostics', '/tf', '/tf_static'}
    assert '/field/robot/somewhere/else' in topics(node)
    assert f'/field/robot/{case.topic}' not in topics(node)
    assert node.get_parameter(case.parameter).value == case.value
    assert node.get_parameter('use_sim_time').value is True


@pytest.mark.parametrize('name', ['simulator', 'diff_drive_controller'])
def test_diagnostics_of_all_are_on_one_topic_and_say_whose_they_are(name, node_of):
    node, sent = node_of(name, '-r', '__ns:=/field/robot'), []
    (publisher,) = (p for p in node.publishers if p.topic_name == '/diagnostics')
    publisher.publish = sent.append
    node.publish_diagnostics(*(['running'] if name == 'simulator' else []))
    assert [status.name for status in sent[0].status] == [f'field/robot/{name}']


@pytest.mark.parametrize('namespace', [(), ('-r', '__ns:=/robot')], ids=['root', 'namespace'])
@pytest.mark.parametrize('name', CASES)
def test_the_file_in_share_changed_in_one_line_changes_one_parameter(
    name, namespace, node_of, tmp_path
):
    case = CASES[name]
    (source,) = ROOT.glob(f'*/config/{name}.yaml')
    ((key, entry),) = yaml.safe_load(source.read_text()).items()
    wanted = entry['ros__parameters']
    assert wanted[case.parameter] != case.value
    wanted[case.parameter] = case.value
    (tmp_path / 'mine.yaml').write_text(yaml.safe_dump({key: entry}))
    node = node_of(name, '--params-file', str(tmp_path / 'mine.yaml'), *namespace)
    # By repr: NaN is no equal of itself, and an int is no float.
    values = {parameter: plain(node.get_parameter(parameter).value) for parameter in wanted}
    assert {p: repr(v) for p, v in values.items()} == {p: repr(v) for p, v in wanted.items()}
    assert_publishers_offer_the_most_and_latch_what_late_joiners_need(node, *namespace[1:])


def assert_publishers_offer_the_most_and_latch_what_late_joiners_need(node, namespace=''):
    """Check the quality of service of each topic; a namespace is `__ns:=/name`."""
    prefix = namespace.removeprefix('__ns:=')
    for publisher in node.publishers:
        topic, profile = publisher.topic_name.removeprefix(prefix), publisher.qos_profile
        if topic in ('/rosout', '/parameter_events'):
            continue
        assert profile.reliability == ReliabilityPolicy.RELIABLE, topic
        latched = profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        assert latched == (topic in LATCHED or topic[1:] in LATCHED), topic


def plain(value: Any) -> Any:
    """Return a value as YAML has it."""
    return value if isinstance(value, (bool, int, float, str)) else list(value)


def test_velocities_go_to_the_mux_of_the_tutorial(node_of):
    node = node_of('keys_to_twist', '-r', 'cmd_vel:=cmd_vel_mux/input/teleop')
    (publisher,) = (p for p in node.publishers if 'cmd_vel' in p.topic_name)
    assert publisher.topic_name == '/cmd_vel_mux/input/teleop'


def test_a_whole_robot_moves_into_a_namespace(spawn, spin_until):
    rules = ('-r', '__ns:=/yard', '-r', 'cmd_vel:=steer', '-p', 'clock_rate:=50.0')
    words = ['go2', '--viewer', 'none', '--duration', '60', '--ros-args', *rules]
    process = programs.start(
        [sys.executable, '-m', 'wasd_bringup.cli', *words], stderr=subprocess.PIPE, text=True
    )
    peer = spawn(Node('peer'))
    asker = peer.create_client(GetParameters, '/yard/simulator/get_parameters')
    try:
        spin_until(spawn.pump, asker.service_is_ready)
        # An answer is lost when the robot has not found the asker yet: it asks until one comes.
        answers: list[Any] = []

        def ask() -> None:
            answers.append(asker.call_async(GetParameters.Request(names=['clock_rate'])))
            spawn.pump.handle(1.0)

        spin_until(spawn.pump, lambda: any(a.done() for a in answers), step=ask)
        future = next(answer for answer in answers if answer.done())
        wanted = {'/yard/steer', '/yard/odom', '/yard/joint_states', '/yard/robot_description'}
        # Time and frames are those of one world: a namespace has its own, as in a launch file.
        wanted |= {'/yard/clock'}
        if importlib.util.find_spec('tf2_msgs'):
            wanted |= {'/yard/tf', '/yard/tf_static'}
        spin_until(
            spawn.pump,
            lambda: wanted <= {name for name, _ in peer.get_topic_names_and_types()},
        )
        assert future.result().values[0].double_value == 50.0
        outside = {'/cmd_vel', '/odom', '/clock', '/tf', '/tf_static'}
        assert not outside & {name for name, _ in peer.get_topic_names_and_types()}
    finally:
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, 'Traceback' in errors) == (0, False), errors
