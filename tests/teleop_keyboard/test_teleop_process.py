# SPDX-License-Identifier: Apache-2.0
"""`teleop` as a process on a real pseudo-terminal: what the robot is told, to the last word."""

from dataclasses import fields
import signal
import subprocess
import sys
import time

import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import ListParameters, SetParameters
from teleop_keyboard.keys_to_twist import STANDSTILL
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


def drive_and_let_go(process, listener):
    """Hold a key for a second, and wait for standstill; return the speeds that were commanded."""
    listener.keys.clear()
    listener.twists.clear()
    hold(process, b'i', 1.0)
    wait_until(lambda: listener.velocities[-1:] == [STANDSTILL])
    listener.settle()
    assert listener.stands
    assert listener.keys == ['i'] * 30
    return [velocity.vx for velocity in listener.velocities]


def test_a_held_key_drives_and_a_released_one_stops_with_one_zero(pty_process, listener):
    process = pty_process(*MODULE)
    listener.probe(process)
    speeds = drive_and_let_go(process, listener)
    for _ in range(2):  # a busy machine is late with a repeat now and then, and the robot stands
        if speeds.count(0.0) > 1:
            speeds = drive_and_let_go(process, listener)
    assert max(speeds) == 0.2
    assert speeds.count(0.0) == 1
    # The ramp up has no step back: nothing is handled twice or late.
    top = speeds.index(0.2)
    assert speeds[:top] == sorted(speeds[:top])
    assert b'space key, k : force stop' in process.output


@pytest.mark.parametrize(
    ('way_out', 'status'),
    [('Ctrl-C', 0), ('SIGTERM', 143), ('SIGHUP', 129), ('exception', 1)],
)
def test_every_way_out_stops_the_robot_and_restores_the_terminal(
    pty_process, listener, way_out, status
):
    arguments = ('-c', RAISE_ON_X) if way_out == 'exception' else MODULE
    process = pty_process(*arguments)
    listener.probe(process)

    def drives() -> bool:
        hold(process, b'u', 0.1)
        return listener.velocities[-1].vx > 0.1

    hold(process, b'u', 0.7)
    wait_until(drives)
    if way_out == 'Ctrl-C':
        process.type(b'\x03')
    elif way_out == 'exception':
        process.type(b'X')
    else:
        process.process.send_signal(getattr(signal, way_out))
    assert process.wait() == status
    listener.settle()
    assert listener.stands
    assert process.attributes == process.before
    assert (b'Traceback' in process.output) == (way_out == 'exception')


def test_parameters_are_listed_and_set_while_it_drives(pty_process, listener):
    process = pty_process(*MODULE)
    listener.probe(process)

    def ask(service_type, name, request):
        client = listener.node.create_client(service_type, f'keys_to_twist/{name}')
        assert client.wait_for_service(PATIENCE)
        answer = client.call_async(request)
        while not answer.done():
            hold(process, b'i', 1 / 30)
        return answer.result()

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
    hold(process, b'i', 1.0)
    assert max(velocity.vx for velocity in listener.velocities) == 0.3
    refused = set_speed(3.0)
    assert not refused.successful
    assert refused.reason == 'speed must be within 0.02 .. 1 (preset mbot), got 3'
    hold(process, b'i', 0.3)
    assert max(velocity.vx for velocity in listener.velocities) == 0.3


def test_a_held_ctrl_c_ends_it_no_less_cleanly(pty_process, listener):
    process = pty_process(*MODULE)
    listener.probe(process)
    hold(process, b'i', 0.5)
    while process.process.poll() is None:
        process.type(b'\x03')
        time.sleep(0.03)
    listener.settle()
    assert listener.stands
    assert process.attributes == process.before
    assert b'Traceback' not in process.output


def test_keys_from_a_pipe_have_their_effect_before_the_end(listener):
    result = subprocess.run(
        [sys.executable, *MODULE],
        input=b'iii',
        capture_output=True,
        start_new_session=True,
        timeout=PATIENCE,
    )
    assert result.returncode == 0
    assert result.stderr == b''
    listener.settle()
    assert max(velocity.vx for velocity in listener.velocities) > 0.05
    assert listener.stands


def test_a_wrong_parameter_is_one_line(ros_domain, pty_process):
    process = pty_process(*MODULE, '--ros-args', '-p', 'preset:=mbto')
    assert process.wait() == 2
    time.sleep(0.2)
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
