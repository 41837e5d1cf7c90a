# SPDX-License-Identifier: Apache-2.0
"""Names and words of others reach a terminal with their control characters made visible."""

from collections.abc import Callable
import json
import os
from pathlib import Path
import re
import signal
import time
from typing import Any

import pytest
import rclpy
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from terminals import PATIENCE
import yaml

pytestmark = pytest.mark.slow

TITLE = '\x1b]0;owned\x07'
SHOWN = '^[]0;owned^G'
BIDI = '\u202e'
CLI, DESCRIBE, KEYBOARDS = (
    'wasd_bringup.cli',
    'robot_description.describe_command',
    'teleop_keyboard',
)
REFUSED = [
    (CLI, 'mbot', '--world', f'x{TITLE}'),
    (CLI, 'mbot', '--play', f'no{TITLE}.txt'),
    (CLI, f'go{TITLE}'),
    (CLI, 'keys', f'no{TITLE}.yaml'),
    (CLI, 'replay', f'no{TITLE}.mcap'),
    (DESCRIBE, 'lint', f'no{TITLE}.urdf'),
    (f'{KEYBOARDS}.teleop_node', f'--{TITLE}'),
    (f'{KEYBOARDS}.key_publisher_node', f'--{TITLE}'),
    (f'{KEYBOARDS}.parameters:keys_to_twist', '--ros-args', '-p', f'preset:={TITLE}'),
]
# Runs the modules of programs one after the other, and says how each ended.
EACH = """
import json, sys
from importlib import import_module
for program, *words in map(json.loads, sys.argv[1:]):
    try:
        module, _, name = program.partition(':')
        status = getattr(import_module(module), name or 'main')(words)
    except SystemExit as end:
        status = end.code
    print('ENDED', status, flush=True)
"""
URDF = f'<robot name="r{BIDI}x\x9by"><link name="base{BIDI}"/></robot>'


@pytest.fixture
def shown(
    environment: dict[str, str], tmp_path: Path, run_on_terminal: Any
) -> Callable[..., list[tuple[str, str]]]:
    """
    Return a function that runs programs on a terminal: what each showed, and its status.

    They are given as module and words, and share a process.
    """

    def run(*programs: tuple[str, ...]) -> list[tuple[str, str]]:
        session = run_on_terminal(['-c', EACH, *map(json.dumps, programs)], environment, tmp_path)
        assert session.end() == 0, session.shown
        parts = re.split(r'ENDED (\d+)\r\n', session.shown)
        return list(zip(parts[:-1:2], parts[1::2], strict=True))

    return run


def test_a_refusal_shows_what_it_quotes(shown: Any) -> None:
    for words, (text, status) in zip(REFUSED, shown(*REFUSED), strict=True):
        assert status == '2', words
        assert 'owned' in text, words
        assert '\x1b]' not in text, words
        assert '\x07' not in text, words


def test_names_in_a_robot_description(shown: Any, tmp_path: Path) -> None:
    (tmp_path / 'robot.urdf').write_text(URDF)
    commands = ('info', 'expand', 'lint')
    told = shown(*((DESCRIBE, command, 'robot.urdf') for command in commands))
    for command, (text, _) in zip(commands, told, strict=True):
        assert 'u202e' in text, command
        assert BIDI not in text, command
        assert '\x9b' not in text, command


def test_a_message_that_is_echoed(
    environment: dict[str, str], monkeypatch: pytest.MonkeyPatch, start: Any, tmp_path: Path,
    run_on_terminal: Any,
) -> None:  # fmt: skip
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    context = rclpy.Context()
    rclpy.init(args=[], context=context)
    node = rclpy.create_node('talker', context=context)
    latched = rclpy.qos.QoSProfile(depth=1, durability=rclpy.qos.DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_publisher(String, 'state', latched).publish(String(data=f'{TITLE}{BIDI}'))
    for field in ([], ['--field', 'data']):
        for _ in range(5):  # on a busy machine a topic may be discovered too late for one
            words = ['-m', CLI, 'echo', 'state', '--once', *field]
            session = run_on_terminal(words, environment, tmp_path)
            if session.end() == 0:
                break
            assert 'no topic' in session.shown
        assert 'owned' in session.shown
        assert '\x1b]' not in session.shown
        assert BIDI not in session.shown
    teleop = run_on_terminal(['-m', 'teleop_keyboard.teleop_node'], environment, tmp_path)
    teleop.wait_for(SHOWN)
    assert TITLE not in teleop.shown
    teleop.process.send_signal(signal.SIGTERM)
    teleop.end()
    node.destroy_node()
    context.try_shutdown()


def test_the_help_of_a_keymap(tmp_path: Path, start: Any) -> None:
    keymap = tmp_path / 'mine.yaml'
    source = Path(__file__).parents[2] / 'teleop_keyboard/teleop_keyboard/presets/mbot.yaml'
    described = yaml.safe_load(source.read_text())
    assert 'Control mbot!' in described['help']
    described['help'] = described['help'].replace('mbot!', f'mbot! {TITLE}{BIDI}')
    keymap.write_text(yaml.safe_dump(described))
    session = start('--preset', os.fspath(keymap))
    session.wait_for('stopped')
    session.type('?')
    session.wait_for(f'Control mbot! {SHOWN}')
    session.type('\x03')
    session.end()
    assert TITLE not in session.shown
    assert BIDI not in session.shown


def test_what_a_node_logs_of_a_message(
    environment: dict[str, str], monkeypatch: pytest.MonkeyPatch, run_on_terminal: Any,
    tmp_path: Path,
) -> None:  # fmt: skip
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    context = rclpy.Context()
    rclpy.init(args=[], context=context)
    node = rclpy.create_node('talker', context=context)
    publisher = node.create_publisher(JointState, 'joint_states', 10)
    module = 'robot_description.state_publisher_node'
    arguments = ['-m', module, '--ros-args', '-p', 'description:=mbot']
    session = run_on_terminal(arguments, environment, tmp_path)
    deadline = time.monotonic() + PATIENCE
    while 'owned' not in session.shown:
        assert time.monotonic() < deadline, session.shown
        publisher.publish(JointState(name=[f'{TITLE}{BIDI}'], position=[0.0]))
        session.read(0.1)
    session.process.send_signal(signal.SIGTERM)
    session.end()
    assert TITLE not in session.shown
    assert BIDI not in session.shown
    node.destroy_node()
    context.try_shutdown()
