# SPDX-License-Identifier: Apache-2.0
"""teleop.launch.py: its arguments, and its process as `ros2 launch` starts it, on a terminal."""

import ast
import dataclasses
from pathlib import Path
import time

import pytest
from teleop_keyboard.keys_to_twist import STANDSTILL
from teleop_keyboard.parameters import TeleopParameters
from teleop_keyboard.twist_messages import from_twist
from terminals import PATIENCE, wait_until

PATH = Path(__file__).parents[2] / 'wasd_bringup' / 'launch' / 'teleop.launch.py'

# What launch does with a process: pipes on all its descriptors, the same session and group, lines
# relayed. It ignores Ctrl-C here, as launch does while its processes end.
LAUNCH = """
import asyncio, signal, sys
async def main():
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(
        sys.executable, '-m', 'teleop_keyboard.teleop_node', *sys.argv[1:],
        stdin=pipe, stdout=pipe, stderr=asyncio.subprocess.STDOUT,
    )
    async for line in process.stdout:
        print('[teleop-1]', line.decode().rstrip(), flush=True)
    sys.exit(await process.wait())
signal.signal(signal.SIGINT, lambda *_: None)
asyncio.run(main())
"""


@pytest.fixture(scope='module')
def launch(launch_file):
    return launch_file(PATH)


def test_every_parameter_is_an_argument_that_says_what_it_means(launch):
    for field in dataclasses.fields(TeleopParameters):
        argument = launch.arguments[field.name]
        assert argument.description == field.metadata['doc']
        assert argument.choices == (list(field.metadata['choices']) or None)
    assert {'use_sim_time', 'namespace', 'cmd_vel', 'keys'} <= set(launch.arguments)


def test_without_arguments_everything_is_as_the_preset_says(launch):
    (node,) = launch.start()
    assert (node.executable, node.namespace) == ('teleop', '')
    parameters = dict(node.parameters)
    assert parameters.pop('use_sim_time') is False
    assert TeleopParameters(**parameters) == TeleopParameters()


def test_arguments_reach_the_node_under_their_types(launch):
    (node,) = launch.start(
        preset='go2',
        speed='1',
        keep_direction='true',
        stamped='true',
        use_sim_time='true',
        cmd_vel='key_vel',
        namespace='go2',
    )
    assert node.parameters['preset'] == 'go2'
    assert (node.parameters['speed'], node.parameters['keep_direction']) == (1.0, True)
    assert (node.parameters['stamped'], node.parameters['use_sim_time']) == (True, True)
    assert (node.namespace, node.remappings['cmd_vel']) == ('go2', 'key_vel')


def test_a_choice_that_is_none_is_refused_before_anything_starts(launch):
    with pytest.raises(RuntimeError, match='layout'):
        launch.start(layout='qwertz')


def test_it_imports_nothing_that_the_stand_in_would_hide():
    tree = ast.parse(PATH.read_text())
    froms = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert froms == {
        'launch',
        'launch.actions',
        'launch.substitutions',
        'launch_ros.actions',
        'teleop_keyboard.parameters',
        'wasd_bringup.ros.launch_parts',
        'wasd_core.parameters',
    }


@pytest.mark.slow
def test_launched_it_reads_keys_and_arrows_and_drives_as_fast_as_it_was_told(
    launch, pty_process, listener, tmp_path
):
    # Neither is the preset's, 0.5 and 1.
    speed, turn = '0.1', '0.4'
    (node,) = launch.start(
        preset='arrows',
        scale_linear=speed,
        scale_angular=turn,
        linear_accel='1000',  # no ramp: the first speed that is published is the full one
        angular_accel='1000',
    )
    process = pty_process('-c', LAUNCH, *node.command_line(tmp_path))
    listener.probe(process)
    for count, (arrow, part) in enumerate(((b'\x1b[A', 'vx'), (b'\x1b[D', 'wz')), 1):
        process.type(arrow)
        listener.wait_for_keys(count)
        listener.wait_for_twist(lambda velocity, part=part: getattr(velocity, part))
        wait_until(lambda: listener.stands)
        listener.settle()
    assert listener.keys == ['UP', 'LEFT']
    velocities = [from_twist(message) for message in listener.twists]
    assert velocities[0] == (float(speed), 0.0, 0.0, 0.0)
    assert set(velocities) == {velocities[0], (0.0, 0.0, 0.0, float(turn)), STANDSTILL}
    process.wait_for(b'[teleop-1] keys UP')
    process.type(b'\x03')
    process.wait()
    deadline = time.monotonic() + PATIENCE
    while process.attributes != process.before:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    assert b'Traceback' not in process.output
