# SPDX-License-Identifier: Apache-2.0
"""The launch files: everything that they name is there, and what they start drives."""

import importlib
from pathlib import Path
import re
import subprocess
import sys
import types

from cases import for_all
from diff_drive_sim.parameters import DiffDriveParameters
from executables import SCRIPTS
from mujoco_sim.parameters import SimulatorParameters
import pytest
from quadruped_sim.parameters import LegNodeParameters
from robot_description.parameters import StatePublisherParameters
from teleop_keyboard.parameters import KeyParameters, TeleopParameters
from terminals import PATIENCE
from wasd_bringup.robots import unitree_help
from wasd_navigation.parameters import NavigatorParameters
import yaml

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / 'wasd_bringup/launch'
FILES = sorted(path.name for path in FOLDER.glob('*.launch.py'))
DEFINITIONS = {
    'diff_drive_controller': DiffDriveParameters,
    'key_publisher': KeyParameters,
    'leg_controller': LegNodeParameters,
    'navigator': NavigatorParameters,
    'simulator': SimulatorParameters,
    'state_publisher': StatePublisherParameters,
    'teleop': TeleopParameters,
}
# Parameters that no definition has: rclpy's own.
OTHER_PARAMETERS = {'use_sim_time'}
# Everything the files can be asked for that starts something else.
ASKED = [{}, {'rviz': 'true'}, {'keys': 'none'}, {'keys': 'wasd'}, {'keys': 'unitree'}]
CASES = [
    (name, asked)
    for name in FILES
    for asked in (ASKED if name in ('go2.launch.py', 'mbot.launch.py') else ASKED[:1])
] + [
    ('both.launch.py', {'rviz': 'true', 'go2_keys': 'none', 'mbot_keys': 'mbot'}),
    ('mbot_nav.launch.py', {'nav': 'nav2', 'map': 'mine.yaml'}),
    ('go2_nav.launch.py', {'nav': 'nav2'}),
]


in_each = for_all(('name', 'asked'), CASES)


def is_foreign(node):
    """Whether a node is none of the project's."""
    return node.package.startswith(('rviz2', 'nav2_', 'slam_toolbox'))


def topics():
    """Return the topics of the project, as its page of them has them."""
    return set(re.findall(r'^\| `([^`]+)`', (ROOT / 'docs/topics.md').read_text(), re.M))


@in_each
def test_every_package_and_executable_exists(launch_file, name, asked):
    started = launch_file(FOLDER / name).start(**asked)
    assert started
    for node in started:
        if not is_foreign(node):
            assert SCRIPTS[node.executable].partition('.')[0] == node.package


@in_each
def test_every_parameter_exists_and_has_a_legal_value(launch_file, name, asked):
    started = launch_file(FOLDER / name).start(**asked)
    for node in started:
        given = {k: v for k, v in node.parameters.items() if k not in OTHER_PARAMETERS}
        if given.get('mode') == '':  # as its file says
            del given['mode']
        if node.package == 'rviz2':
            assert not given
        elif is_foreign(node):
            continue  # see test_navigation_files.py
        elif node.executable in DEFINITIONS:
            definition = DEFINITIONS[node.executable]
            definition.from_mapping(given)


@in_each
def test_every_file_exists_and_is_for_the_node_that_gets_it(launch_file, name, asked):
    started = launch_file(FOLDER / name).start(**asked)
    for node in started:
        for path in node.files:
            if is_foreign(node):
                assert path.is_file()
                continue
            ((key, _),) = yaml.safe_load(path.read_text()).items()
            assert key in ('/**', f'/**/{node.executable}')
        for argument in node.arguments:
            assert argument == '-d' or Path(argument).is_file()


@in_each
def test_every_renamed_topic_is_one_of_ours(launch_file, name, asked):
    started = launch_file(FOLDER / name).start(**asked)
    for node in started:
        assert is_foreign(node) or set(node.remappings) <= topics()


@in_each
def test_the_launch_ends_with_a_node_without_which_nothing_drives(launch_file, name, asked):
    started = launch_file(FOLDER / name).start(**asked)
    for node in started:
        is_keyboard = node.executable in ('key_publisher', 'teleop')
        is_needed = len(started) == 1 or not (is_foreign(node) or is_keyboard)
        assert node.ends_all == is_needed, node.executable


@pytest.mark.slow
@pytest.mark.parametrize(
    ('name', 'asked', 'culprit', 'words'),
    [
        ('mbot.launch.py', {'world': 'nope'}, 'simulator', 'nope'),
        ('mbot.launch.py', {'controller': 'nothing.yaml'}, 'diff_drive_controller', 'nothing'),
        ('go2.launch.py', {'description': 'no_dog.urdf'}, 'leg_controller', 'no_dog'),
        ('mbot_nav.launch.py', {'map': 'no_map.yaml'}, 'navigator', 'no_map'),
    ],
)
def test_a_node_that_cannot_start_says_why_and_ends_the_launch(
    launch_file, tmp_path, name, asked, culprit, words
):
    nodes = launch_file(FOLDER / name).start(**asked)
    (node,) = (node for node in nodes if node.executable == culprit)
    process = node.process(tmp_path, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    _, said = process.communicate(timeout=PATIENCE)
    assert node.ends_all
    assert process.returncode not in (0, None)
    assert words in said
    assert 'Traceback' not in said


def test_each_robot_has_a_namespace_a_clock_and_frames_of_its_own(launch_file):
    nodes = launch_file(FOLDER / 'both.launch.py').start()
    assert {node.namespace for node in nodes} == {'go2', 'mbot'}
    for node in nodes:
        # Relative names: the namespace prefixes them.
        assert node.remappings == {'/clock': 'clock', '/tf': 'tf', '/tf_static': 'tf_static'}
    robots = {
        node.namespace: node.parameters['description']
        for node in nodes
        if node.executable == 'simulator'
    }
    assert robots == {'go2': 'go2', 'mbot': 'mbot'}


@pytest.mark.parametrize('name', ['rname', 'description'])
def test_the_robot_can_be_named_as_everywhere_and_as_in_the_tutorial(launch_file, name):
    given = {name: 'my/dog.urdf', 'seed': '3', 'speed': '2'}
    nodes = launch_file(FOLDER / 'go2.launch.py').start(**given)
    described = [node.parameters.get('description') for node in nodes]
    assert described == ['my/dog.urdf', 'my/dog.urdf', 'my/dog.urdf', None]
    assert (nodes[0].parameters['seed'], nodes[0].parameters['speed']) == (3, 2.0)


@pytest.mark.parametrize('name', ['go2.launch.py', 'mbot.launch.py'])
def test_a_parameter_file_of_the_users_is_for_every_node_and_comes_first(
    launch_file, name, tmp_path
):
    nodes = launch_file(FOLDER / name).start(params_file=str(tmp_path / 'mine.yaml'))
    robots = [node for node in nodes if node.package not in ('teleop_keyboard', 'rviz2')]
    assert len(robots) == 3
    for node in robots:
        assert node.files == [tmp_path / 'mine.yaml']
    definition = launch_file(FOLDER / name).nodes[0]
    assert isinstance(definition.parameters[0], dict), 'the last one counts'


def test_the_drive_can_be_chosen_as_on_the_command_line(launch_file):
    nodes = launch_file(FOLDER / 'mbot.launch.py').start(mode='arbotix', controller='drive.yaml')
    (drive,) = (node for node in nodes if node.executable == 'diff_drive_controller')
    assert (drive.parameters['mode'], drive.parameters['controller']) == ('arbotix', 'drive.yaml')
    assert drive.parameters['use_sim_time'] is True
    (simulator,) = (node for node in nodes if node.executable == 'simulator')
    assert simulator.parameters['controller'] == 'drive.yaml'  # which may name wheels


def test_without_physics_no_simulator_and_no_simulated_time_are_there(launch_file):
    nodes = launch_file(FOLDER / 'mbot.launch.py').start(mode='fake')
    assert sorted(node.executable for node in nodes) == [
        'diff_drive_controller', 'state_publisher', 'teleop',
    ]  # fmt: skip
    assert {node.parameters['use_sim_time'] for node in nodes} == {False}


@pytest.mark.slow
def test_both_robots_can_be_chosen_and_share_seed_and_speed(launch_file):
    nodes = launch_file(FOLDER / 'both.launch.py').start(
        go2_description='a1', mbot_description='mbot_lidar', seed='4', speed='2'
    )
    simulators = {n.namespace: n.parameters for n in nodes if n.executable == 'simulator'}
    robots = {name: each['description'] for name, each in simulators.items()}
    assert robots == {'go2': 'a1', 'mbot': 'mbot_lidar'}
    assert {(each['seed'], each['speed']) for each in simulators.values()} == {(4, 2.0)}


@pytest.mark.parametrize(
    ('keys', 'executables'),
    [('unitree', ['key_publisher']), ('go2', ['teleop']), ('none', [])],
)
def test_one_keyboard_or_none_is_started(launch_file, keys, executables):
    nodes = launch_file(FOLDER / 'go2.launch.py').start(keys=keys)
    assert [n.executable for n in nodes if n.package == 'teleop_keyboard'] == executables


def test_the_keyboard_of_the_go2_shows_its_keys_as_wasd_does(launch_file):
    nodes = launch_file(FOLDER / 'go2.launch.py').start()
    (keyboard,) = (node for node in nodes if node.executable == 'key_publisher')
    assert keyboard.parameters['help'].splitlines() == list(unitree_help('qwerty'))


@for_all('path', sorted((ROOT / 'wasd_bringup/rviz').glob('*.rviz')))
def test_rviz_shows_topics_that_exist(path):
    shown = re.findall(r'^ +(?:Topic|Value): ([a-z_/]+)$', path.read_text(), re.M)
    assert {'robot_description', 'odom'} <= set(shown)
    assert {name for name in shown if name not in ('true', 'false')} <= topics()


def test_what_launch_itself_has_read_is_read_anew_without_it(launch_file, monkeypatch):
    of_launch = types.ModuleType('wasd_bringup.ros.launch_parts')
    monkeypatch.setitem(sys.modules, of_launch.__name__, of_launch)
    assert launch_file(FOLDER / 'mbot_nav.launch.py').start()
    assert sys.modules[of_launch.__name__] is of_launch


@pytest.mark.parametrize('name', FILES)
def test_launch_itself_can_read_the_file(name):
    sources = pytest.importorskip('launch.launch_description_sources', reason='no launch here')
    importlib.import_module('launch_ros')
    path = str(FOLDER / name)
    assert sources.get_launch_description_from_python_launch_file(path).entities
