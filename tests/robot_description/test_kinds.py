# SPDX-License-Identifier: Apache-2.0
"""Robots that nobody here drives are called what they are, by their shape."""

from dataclasses import replace

from descriptions import robot_named
import pytest
from robot_description.description import read_description
from robot_description.packages import share_directory

pytestmark = pytest.mark.slow
ROBOTS = share_directory('example-robot-data') / 'robots'


def test_a_robot_that_cannot_be_simulated_is_called_what_it_is():
    """Those that can: see test_any_robot.py."""
    kind = read_description(ROBOTS / 'romeo_description/urdf/romeo.urdf').nature
    assert kind.what.partition(' (')[0] == 'a humanoid'
    assert kind.cure


def test_links_that_are_called_rotors_make_no_drone_of_a_robot_on_legs():
    go2 = robot_named('go2')
    robot = go2.robot
    assert sum('rotor' in link for link in robot.links) > 4
    fixed = replace(robot.joints['RR_hip_joint'], kind='fixed')
    robot = replace(robot, joints={**robot.joints, 'RR_hip_joint': fixed})
    kind = replace(go2, robot=robot).nature
    assert kind.what.startswith('a robot on 4 legs')
