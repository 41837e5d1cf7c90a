# SPDX-License-Identifier: Apache-2.0
"""Files for slam_toolbox and Nav2: names that these know, and frames and topics that are ours."""

import ast
from pathlib import Path

from cases import for_all
from descriptions import robot_named
from mujoco_sim.sensors.table import read_sensor_tags
import pytest
from wasd_bringup.robots import ROBOTS as ROWS
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.run.navigation import _settings
from wasd_bringup.run.options import RunOptions
from wasd_navigation.parameters import NavigatorParameters
import yaml

ROOT = Path(__file__).resolve().parents[2]
LAUNCH, CONFIG = ROOT / 'wasd_bringup/launch', ROOT / 'wasd_bringup/config'
ROBOTS = {
    'mbot': ('slam_toolbox_mbot.yaml', 'nav2.yaml'),
    'go2': ('slam_toolbox_go2.yaml', 'nav2.yaml', 'nav2_go2.yaml'),
}
FILES = sorted({name for names in ROBOTS.values() for name in names})
NAV2 = [
    *('controller_server', 'smoother_server', 'planner_server', 'behavior_server'),
    *('velocity_smoother', 'collision_monitor', 'bt_navigator'),
]


def flattened(tree, prefix=''):
    """Return parameters by their full names, the nodes' names first."""
    found = {}
    for name, value in tree.items():
        if name == 'ros__parameters':
            found |= flattened(value, prefix)
        elif isinstance(value, dict):
            found |= flattened(value, f'{prefix}{name}.')
        else:
            found[f'{prefix}{name}'] = value
    return found


def parameters(*names):
    """Return what files say together, the later ones on top."""
    found = {}
    for name in names:
        found |= flattened(yaml.safe_load((CONFIG / name).read_text()))
    return found


@pytest.fixture(scope='module')
def known():
    lines = Path(__file__).with_name('nav2_parameters.txt').read_text().splitlines()
    pairs = (line.split(' = ') for line in lines if ' = ' in line)
    return {name: ast.literal_eval(value) for name, value in pairs}


@pytest.mark.parametrize('name', FILES)
def test_every_parameter_is_one_of_the_packages_and_of_its_type(known, name):
    found = parameters(name)
    assert set(found) <= set(known)
    assert {k: type(v) for k, v in found.items()} == {k: type(known[k]) for k in found}


def test_no_name_is_kept_that_no_file_has(known):
    assert set(known) == set().union(*(parameters(name) for name in FILES))


@for_all('robot', ROBOTS)
def test_frames_are_the_robots_and_the_lidars_range_is_its_own(robot):
    loaded, found = robot_named(robot), parameters(*ROBOTS[robot])
    bases = {value for name, value in found.items() if name.split('.')[-1] in BASES}
    assert bases == {loaded.robot.root}
    ((lidar,), *_), _ = read_sensor_tags(loaded.robot)
    assert found['slam_toolbox.max_laser_range'] == lidar.max_range
    # No scan is to be left out.
    assert found['slam_toolbox.minimum_time_interval'] < 1.0 / lidar.rate


BASES = ('base_frame', 'base_frame_id', 'robot_base_frame')


@for_all('robot', ROBOTS)
def test_scans_and_velocities_are_our_topics(robot):
    found = parameters(*ROBOTS[robot])
    assert found['collision_monitor.cmd_vel_out_topic'] == mux()['topics.navigation.topic']
    scans = {v for k, v in found.items() if k.endswith(('scan.topic', 'scan_topic'))}
    assert {topic.lstrip('/') for topic in scans} == {'scan'}


def mux():
    (found,) = yaml.safe_load(
        (ROOT / 'teleop_keyboard/config/twist_mux.yaml').read_text()
    ).values()
    return flattened(found)


def test_the_smoother_asks_no_more_of_a_robot_than_the_controller_may():
    for names in ROBOTS.values():
        found = parameters(*names)
        forward, sideways, turn = found['velocity_smoother.max_velocity']
        assert found['controller_server.FollowPath.vx_max'] <= forward
        assert found.get('controller_server.FollowPath.vy_max', 0.0) <= sideways
        assert found['controller_server.FollowPath.wz_max'] <= turn


@pytest.mark.parametrize('robot', ROBOTS)
def test_nav2_drives_a_robot_that_it_maps_and_keys_come_first(launch_file, robot):
    started = launch_file(LAUNCH / f'{robot}_nav.launch.py').start(nav='nav2', world='flat:3')
    nodes = {node.executable: node for node in started if node.executable != 'lifecycle_manager'}
    assert {'simulator', 'state_publisher', 'twist_mux', *NAV2} <= set(nodes)
    assert nodes['simulator'].parameters['world'] == 'flat:3'
    (manager,) = (node for node in started if node.executable == 'lifecycle_manager')
    assert manager.parameters['node_names'] == NAV2
    assert 'amcl' not in nodes
    slam = nodes['online_async_launch.py']
    assert slam.package == 'slam_toolbox'
    file = ROBOTS[robot][0]
    assert slam.parameters == {'use_sim_time': 'true', 'slam_params_file': str(CONFIG / file)}
    for name in NAV2:
        assert [path.name for path in nodes[name].files] == [*ROBOTS[robot][1:]]
        assert nodes[name].parameters == {'use_sim_time': True}


def test_the_keys_of_a_keymap_go_to_the_mux(launch_file):
    started = launch_file(LAUNCH / 'mbot_nav.launch.py').start()
    (teleop,) = (node for node in started if node.executable == 'teleop')
    assert teleop.remappings['cmd_vel'] == mux()['topics.keyboard.topic']
    (chooser,) = (node for node in started if node.executable == 'twist_mux')
    assert chooser.remappings == {'cmd_vel_out': 'cmd_vel'}


@pytest.mark.parametrize('robot', ROBOTS)
def test_our_navigator_is_alone_and_a_source_of_the_mux(launch_file, robot):
    started = launch_file(LAUNCH / f'{robot}_nav.launch.py').start(map='mine.yaml')
    nodes = {node.executable: node for node in started}
    assert not [node for node in started if node.package.startswith(('nav2_', 'slam'))]
    navigator = nodes['navigator']
    assert navigator.remappings == {'cmd_vel': mux()['topics.navigation.topic']}
    assert navigator.parameters == {'use_sim_time': True, 'map': 'mine.yaml'}
    assert [path.name for path in navigator.files] == [f'navigator_{robot}.yaml']


@pytest.mark.slow
@pytest.mark.parametrize('robot', ROBOTS)
@pytest.mark.usefixtures('ros')
def test_our_navigator_knows_a_robot_as_wasd_does(robot):
    row = ROWS[robot]
    options = RunOptions(robot=robot, description=row.description, preset=row.preset, speed=0.0)
    session = make_ros_run(options)
    asked = _settings(session.robot)
    session.close()
    ((_, given),) = yaml.safe_load((CONFIG / f'navigator_{robot}.yaml').read_text()).items()
    settings = NavigatorParameters.from_mapping(given['ros__parameters'])
    for name, value in asked.items():
        assert settings.value(name) == pytest.approx(value, abs=1e-3), name


def test_with_a_map_nav2_localises_in_it_and_makes_none(launch_file):
    started = launch_file(LAUNCH / 'mbot_nav.launch.py').start(nav='nav2', map='mine.yaml')
    nodes = {node.executable: node for node in started}
    assert nodes['map_server'].parameters['yaml_filename'] == 'mine.yaml'
    assert 'amcl' in nodes
    assert 'online_async_launch.py' not in nodes


@for_all('robot', ROBOTS)
def test_amcl_begins_where_a_simulated_robot_starts_in_a_map_that_it_made(robot):
    found = parameters(*ROBOTS[robot])
    assert found['amcl.set_initial_pose'] is True
    assert {found[f'amcl.initial_pose.{name}'] for name in ('x', 'y', 'z', 'yaw')} == {0.0}


def own_footprint(robot):
    """Return the footprint of our navigator's file."""
    found = flattened(yaml.safe_load((CONFIG / f'navigator_{robot}.yaml').read_text()))
    settings = NavigatorParameters().changed(
        {name.partition('.')[2]: value for name, value in found.items()}
    )
    return settings.footprint


def test_nav2_has_the_footprints_of_our_navigator():
    said = parameters('nav2.yaml', 'nav2_go2.yaml')
    costmaps = [f'{where}_costmap.{where}_costmap' for where in ('local', 'global')]
    for costmap in costmaps:
        assert said[f'{costmap}.robot_radius'] == own_footprint('mbot').radius
        corners = ast.literal_eval(said[f'{costmap}.footprint'])
        half = own_footprint('go2')
        assert {abs(x) for x, _ in corners} == {half.half_length}
        assert {abs(y) for _, y in corners} == {half.half_width}
