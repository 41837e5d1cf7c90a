# SPDX-License-Identifier: Apache-2.0
"""Robots that nobody here drives are called what they are, by their shape."""

from dataclasses import replace

from cases import for_all
from descriptions import robot_named
import pytest
from robot_description.description import read_description
from robot_description.morphology.kinds import name_kind
from robot_description.packages import share_directory

pytestmark = pytest.mark.slow
ROBOTS = share_directory('example-robot-data') / 'robots'
KINDS = {
    'a1_description/urdf/a1': 'a quadruped',
    'anymal_b_simple_description/robots/anymal-kinova': 'a quadruped',
    'baxter_description/urdf/baxter': 'a robot of 2 arms',
    'bolt_description/robots/bolt': 'a biped',
    'centauro_description/urdf/centauro': 'a wheel-legged robot',
    'g1_description/urdf/g1_29dof_rev_1_0': 'a humanoid',
    'icub_description/robots/icub': 'a humanoid',
    'iris_description/robots/iris': 'a drone',
    'iris_description/robots/iris_simple': 'a drone',
    'kinova_description/robots/kinova': 'an arm',
    'panda_description/urdf/panda': 'an arm',
    'romeo_description/urdf/romeo': 'a humanoid',
    'solo_description/robots/solo': 'a robot on 4 legs',
    'talos_data/robots/talos_reduced': 'a humanoid',
    'tiago_description/robots/tiago': 'a robot on two driven wheels',
    'tiago_pro_description/robots/tiago_pro': 'a skid-steer',
    'ur_description/urdf/ur10_robot': 'an arm',
    'ur_description/urdf/ur5_robot': 'an arm',
    'z1_description/urdf/z1': 'an arm',
}


@for_all('name', KINDS)
def test_a_robot_of_example_robot_data_is_called_what_it_is(name):
    kind = name_kind(read_description(ROBOTS / f'{name}.urdf').robot)
    assert kind.what.partition(' (')[0] == KINDS[name]
    assert kind.cure


def test_links_that_are_called_rotors_make_no_drone_of_a_robot_on_legs():
    robot = robot_named('go2').robot
    assert sum('rotor' in link for link in robot.links) > 4
    fixed = replace(robot.joints['RR_hip_joint'], kind='fixed')
    kind = name_kind(replace(robot, joints={**robot.joints, 'RR_hip_joint': fixed}))
    assert kind.what.startswith('a robot on 4 legs')
