# SPDX-License-Identifier: Apache-2.0
import sys

import programs
import pytest
from terminals import PATIENCE

pytestmark = pytest.mark.slow

MODULES = ['key_publisher_node', 'keys_to_twist_node', 'teleop_node']


@pytest.mark.parametrize('module', MODULES)
def test_malformed_ros_arguments_are_one_line_and_status_2(isolated_ros, module):
    command = [sys.executable, '-m', f'teleop_keyboard.{module}', '--ros-args', '-p', 'bad']
    done = programs.run(command, input='i', text=True, timeout=PATIENCE)
    assert done.returncode == 2
    said = "ROS: Couldn't parse parameter override rule: '-p bad'"
    assert done.stderr == f'error: {said}\n'


@pytest.mark.parametrize('module', MODULES[1:])
def test_a_misspelt_parameter_is_told_and_the_others_count(pty_process, module):
    given = ('-p', 'sped:=1.0', '-p', 'turn:=0.7', '-p', 'mode:=latch')
    process = pty_process('-m', f'teleop_keyboard.{module}', '--ros-args', *given)
    process.wait_for(b"unknown parameter 'sped', did you mean speed?: ignored")
