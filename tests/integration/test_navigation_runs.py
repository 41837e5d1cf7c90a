# SPDX-License-Identifier: Apache-2.0
"""Whole runs with `--map`: a map is made, saved, found again, and goals in it are reached."""

import math
from pathlib import Path

from nav_msgs.msg import OccupancyGrid
import numpy as np
import pytest
from rclpy.node import Node
from teleop_keyboard.key_script import parse_key_script
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run
from wasd_core.errors import UserError
from wasd_core.node import MessagePump
from wasd_core.topics import LATCHED

pytestmark = pytest.mark.slow

WORLD = 'flat:3'
NEAR = (0.0, 0.5, 1.5)


def run(seconds, robot='mbot', listens=False, **more):
    """Run a robot that navigates till its goals are done with; return its report."""
    options = {'preset': robot, 'description': robot, 'map': '', **more}
    asked = RunOptions(robot=robot, world=WORLD, speed=0.0, samples=True, **options)
    session = make_ros_run(asked) if listens else Run(asked)
    pump, heard = MessagePump(), []
    if listens:
        node = Node('listener')
        pump.add_node(node)
        for topic in ('map', 'global_costmap/costmap'):
            node.create_subscription(OccupancyGrid, topic, heard.append, LATCHED)
    try:
        for _ in range(round(10 * seconds)):
            session.simulation.advance(100)
            if listens:
                pump.handle(0.02 if not heard else 0.0)
            if len(session.navigations[0].report()['goals']) == len(options['goals']):
                break
        report = session.report()
        return report | {'heard': len(heard), 'samples': dict(report['samples'])}
    finally:
        pump.shutdown(timeout_sec=0.0)
        session.close()


@pytest.fixture(scope='module')
def drives(tmp_path_factory):
    """Return a folder, and what is kept of a drive that several tests look at."""
    return tmp_path_factory.mktemp('house'), []


@pytest.fixture
def house(ros, drives):
    """Return the map that a drive to a goal has saved, and the drive's report."""
    folder, reports = drives
    if not reports:
        reports.append(map_and_save(folder / 'house'))
    return folder / 'house', reports[0]


def map_and_save(path, **more):
    return run(7.0, goals=(NEAR,), save_map=str(path), **more)


def error_of(goal, place):
    """Return how far a goal [m] and its yaw [rad] are from a pose."""
    turn = math.remainder(goal['goal'][2] - place[2], 2.0 * math.pi)
    return math.dist(goal['goal'][:2], place[:2]), abs(turn)


def test_the_same_seed_makes_the_same_map_and_path_to_the_last_byte_whoever_listens(
    house, tmp_path
):
    path, first = house
    second = map_and_save(tmp_path / 'second', listens=True)
    assert second['heard'] > 0
    for ending in ('pgm', 'yaml'):
        one, other = (
            each.with_suffix(f'.{ending}').read_bytes() for each in (path, tmp_path / 'second')
        )
        assert one == other.replace(b'second', b'house')
    assert first['samples'] == second['samples']
    assert first['navigation'] == second['navigation']
    (goal,) = first['navigation']['goals']
    assert goal['state'] == 'arrived'
    distance, turn = error_of(goal, goal['truth'])
    assert distance <= 0.05
    assert turn <= math.radians(3.0)


def test_a_robot_finds_its_place_in_a_saved_map_and_drives_there(house):
    path, _ = house
    report = run(11.0, map=str(path.with_suffix('.yaml')), goals=(NEAR,))['navigation']
    (goal,) = report['goals']
    assert goal['state'] == 'arrived'
    assert error_of(goal, goal['truth'])[0] <= 0.05
    assert np.array(goal['pose']) == pytest.approx(np.array(goal['truth']), abs=0.03)


def test_the_go2_maps_with_the_lidar_on_its_back_and_walks_to_a_goal(ros):
    keys = tuple(parse_key_script('0.3 2\n1.6 5', 'keys'))
    report = run(9.0, 'go2', preset='unitree', keys=keys, goals=((0.0, 0.5, 0.0),))
    (goal,) = report['navigation']['goals']
    assert goal['state'] == 'arrived', goal['reason']
    distance, turn = error_of(goal, goal['truth'])
    assert distance <= 0.10
    assert turn <= math.radians(5.0)
    assert report['falls'] == 0


def test_a_map_without_a_scan_is_not_written_and_says_so(ros, tmp_path):
    name = tmp_path / 'nothing'
    session = Run(
        RunOptions(
            robot='mbot', description='mbot', preset='mbot', speed=0.0, map='', save_map=str(name)
        )
    )
    with pytest.raises(UserError, match='no map yet: no scan has come'):
        session.close()
    assert list(Path(tmp_path).iterdir()) == []
