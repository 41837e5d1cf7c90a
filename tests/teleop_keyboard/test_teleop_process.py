# SPDX-License-Identifier: Apache-2.0
"""`teleop` as a process on a real pseudo-terminal: what the robot is told, to the last word."""

from dataclasses import fields
import itertools
import subprocess
import sys
import time

import programs
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import ListParameters, SetParameters
from teleop_keyboard.parameters import TeleopParameters
from terminals import PATIENCE, wait_until

pytestmark = pytest.mark.slow

MODULE = ('-m', 'teleop_keyboard.teleop_node')

RAISE_ON_X = """
import sys
from teleop_keyboard import teleop_node as module
publish = module.KeyPublisherNode.publish_key
def publish_or_raise(self, key):
    if key == 'X':
        raise ValueError('as the test wishes')
    publish(self, key)
module.KeyPublisherNode.publish_key = publish_or_raise
sys.exit(module.main())
"""


def hold(process, key, seconds):
    for _ in range(round(seconds * 30)):
        process.type(key)
        time.sleep(1 / 30)


def test_a_held_key_drives_and_a_released_one_stops_with_one_zero(pty_process, listener):
    process = pty_process(*MODULE)
    listener.probe(process)
    presses = 0

    def speeds():
        return [velocity.vx for velocity in listener.velocities]

    def is_at_full_speed():
        nonlocal presses
        hold(process, b'i', 1 / 30)
        presses += 1
        return 0.2 in speeds()

    wait_until(is_at_full_speed)
    wait_until(lambda: listener.stands)
    listener.settle(presses)
    assert listener.stands
    assert listener.keys == ['i'] * presses
    assert max(speeds()) == 0.2
    # A zero is told once: another stands only where a busy machine was late with a repeat.
    assert all(max(pair) > 0.0 for pair in itertools.pairwise(speeds()))
    assert b'space key, k : force stop' in process.output


def test_an_exception_stops_the_robot_and_restores_the_terminal(pty_process, listener):
    process = pty_process('-c', RAISE_ON_X)
    listener.probe(process)
    listener.drive(process)
    process.type(b'X')
    assert process.wait() == 1
    wait_until(lambda: listener.stands)
    listener.settle()
    assert listener.stands
    assert process.attributes == process.before
    assert b'Traceback' in process.output


def test_parameters_are_listed_and_set_while_it_drives(pty_process, listener):
    process = pty_process(*MODULE)
    listener.probe(process)

    def ask(service_type, name, request):
        client = listener.node.create_client(service_type, f'keys_to_twist/{name}')
        assert client.wait_for_service(PATIENCE)
        answers = []

        def is_answered():
            # An answer is lost when the service has not found the asker yet: it asks until one
            # comes.
            answers.append(client.call_async(request))
            hold(process, b'i', 0.2)
            return any(answer.done() for answer in answers)

        wait_until(is_answered)
        return next(answer.result() for answer in answers if answer.done())

    def set_speed(value):
        number = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
        parameter = Parameter(name='speed', value=number)
        (result,) = ask(
            SetParameters, 'set_parameters', SetParameters.Request(parameters=[parameter])
        ).results
        return result

    listed = ask(ListParameters, 'list_parameters', ListParameters.Request()).result.names
    assert {field.name for field in fields(TeleopParameters)} <= set(listed)
    assert set_speed(0.3).successful
    listener.wait_for_twist(lambda velocity: velocity.vx == 0.3, lambda: process.type(b'i'))
    assert max(velocity.vx for velocity in listener.velocities) == 0.3
    refused = set_speed(3.0)
    assert not refused.successful
    assert refused.reason == 'speed must be within 0.02 .. 1 (preset mbot), got 3'
    hold(process, b'i', 0.3)
    assert max(velocity.vx for velocity in listener.velocities) == 0.3


def test_a_held_ctrl_c_stops_the_robot_and_restores_the_terminal(pty_process, listener):
    process = pty_process(*MODULE)
    listener.probe(process)
    listener.drive(process)
    while process.process.poll() is None:
        process.type(b'\x03')
        time.sleep(0.03)
    assert process.wait() == 0
    wait_until(lambda: listener.stands)
    listener.settle()
    assert listener.stands
    assert process.attributes == process.before
    assert b'Traceback' not in process.output


def test_keys_from_a_pipe_have_their_effect_before_the_end_and_are_told_in_plain_lines(listener):
    result = subprocess.run(
        [sys.executable, *MODULE],
        input=b'iii',
        capture_output=True,
        start_new_session=True,
        timeout=PATIENCE,
    )
    assert result.returncode == 0
    assert result.stderr == b''
    assert b'\x1b' not in result.stdout
    assert b'Control mbot!' in result.stdout
    assert b'target forward +0.20' in result.stdout
    # How fast it gets in the 0.15 s that these count is up to who else has the processor.
    listener.wait_for_twist(lambda velocity: velocity.vx > 0.0)
    wait_until(lambda: listener.stands)
    listener.settle()
    assert listener.stands


def test_keys_from_a_pipe_beside_a_terminal_have_their_effect_before_the_end(
    pty_process, listener
):
    process = pty_process(*programs.IN_SHELL, 'printf iii | "$0" "$@"', *MODULE)
    assert process.wait() == 0
    # How fast it gets in the 0.15 s that these count is up to who else has the processor.
    listener.wait_for_twist(lambda velocity: velocity.vx > 0.0)
    wait_until(lambda: listener.stands)
    listener.settle()
    assert listener.stands


@pytest.mark.parametrize('mode', ['latch', 'step'])
def test_a_pipe_in_a_mode_that_drives_on_ends_with_a_zero(listener, mode):
    result = subprocess.run(
        [sys.executable, *MODULE, '--ros-args', '-p', 'preset:=wasd', '-p', f'mode:={mode}'],
        input=b'w',
        capture_output=True,
        start_new_session=True,
        timeout=PATIENCE,
    )
    assert result.returncode == 0
    wait_until(lambda: listener.stands)
    listener.settle()
    assert listener.stands


def test_a_wrong_parameter_is_one_line(ros_domain, pty_process):
    process = pty_process(*MODULE, '--ros-args', '-p', 'preset:=mbto')
    assert process.wait() == 2
    (line,) = process.output.decode().splitlines()
    assert line.startswith("error: unknown preset 'mbto', did you mean mbot?")
    assert process.attributes == process.before


def test_the_help_key_shows_every_key_and_w_says_which_keys_drive(pty_process, ros_domain):
    process = pty_process(*MODULE)
    process.wait_for(b'Control mbot!')
    process.type(b'w')
    process.wait_for(b'drive with i , j l; w is speed +10 %')
    process.type(b'?')
    process.wait_for(b'forward + turn left')
    process.type(b'\x03')
    assert process.wait() == 0
