# SPDX-License-Identifier: Apache-2.0
import os
import sys

import programs
import pytest
import rclpy
from teleop_keyboard.key_reader import KeyReader
from teleop_keyboard.keys_to_twist_node import KeysToTwistNode
from teleop_keyboard.teleop_node import Teleop
from teleop_keyboard.terminal import Source
from terminals import PATIENCE
from wasd_core.node import init_ros, run_node

pytestmark = pytest.mark.slow

MISSPELT = ['--ros-args', '-p', 'sped:=1.0', '-p', 'turn:=0.7', '-p', 'mode:=latch']
WARNING = "unknown parameter 'sped', did you mean speed?: ignored"


@pytest.mark.parametrize('module', ['key_publisher_node', 'teleop_node'])
def test_malformed_ros_arguments_are_one_line_and_status_2(isolated_ros, module):
    command = [sys.executable, '-m', f'teleop_keyboard.{module}', '--ros-args', '-p', 'bad']
    done = programs.run(command, input='i', text=True, timeout=PATIENCE)
    assert done.returncode == 2
    said = "ROS: Couldn't parse parameter override rule: '-p bad'"
    assert done.stderr == f'error: {said}\n'


def told_of(twist):
    return (twist.logic.turn, twist.logic.motion.mode)


def test_a_misspelt_parameter_is_told_and_the_others_count(isolated_ros, capfd):
    told = []
    run_node(KeysToTwistNode, MISSPELT, lambda node, stop: told.append(told_of(node)))
    assert told == [(0.7, 'latch')]
    assert WARNING in capfd.readouterr().err


def test_teleop_tells_a_misspelt_parameter_and_the_others_count(isolated_ros, capfd):
    reading, writing = os.pipe()
    init_ros(MISSPELT)
    with KeyReader(None, Source(reading)) as reader:
        teleop = Teleop(reader)
        assert told_of(teleop.twist) == (0.7, 'latch')
        teleop.close()
    rclpy.try_shutdown()
    for end in (reading, writing):
        os.close(end)
    assert WARNING in capfd.readouterr().err
