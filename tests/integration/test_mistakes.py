# SPDX-License-Identifier: Apache-2.0
"""A user's mistake gets one line that says what is wrong, and never a traceback."""

from collections.abc import Callable
from pathlib import Path
import socket
import subprocess

from cases import for_all
import pytest

pytestmark = pytest.mark.slow

Wasd = Callable[..., 'subprocess.CompletedProcess[str]']

MISTAKES = [
    (['mbot', '--no-such-option'], '--no-such-option'),
    (['replay', 'x.mcap', '--port', '99999'], "--port: got '99999', wanted 0 to 65535"),
    (
        ['pub', '/x', 'std_msgs/msg/Empty', '-r', '1e308'],
        "got '1e308', wanted a number > 0 and <=",
    ),
    (['describe', 'foo'], "invalid choice: 'foo' (choose from 'policy', 'expand'"),
    (['mbot', '--keepout', 'nowhere.yaml'], '--keepout nowhere.yaml: no such file'),
    (['fly'], "invalid choice: 'fly'"),
    (['mbot', '--play', 'nowhere.txt'], '--play nowhere.txt: no such file'),
    (['mbot', '--twist', 'nowhere.txt'], '--twist nowhere.txt: no such file'),
    (['mbot', '--play', '.'], '--play .: is a folder'),
    (['mbot', '--play', 'broken.keys'], 'broken.keys:3:'),
    (['mbot', '--twist', 'broken.twist'], 'broken.twist:2:'),
    (['mbot', '--push', '1 2 3'], "wanted 't fx fy fz seconds [x y z]'"),
    (['mbot', '--duration', 'long'], '--duration'),
    (['mbot', '--speed', '-1'], '--speed'),
    (['mbot', '--seed', '-1'], '--seed'),
    (['mbot', '--seed', 'x'], '--seed'),
    (['mbot', '--viewer', 'hologram'], '--viewer'),
    (['mbot', '--duration', '1', '--world', 'moon'], 'worlds: flat, room'),
    (['mbot', '--duration', '1', '--world', 'broken.twist'], 'broken.twist'),
    (['mbot', '--duration', '1', '--description', 'nowhere.xacro'], 'nowhere.xacro'),
    (['mbot', '--duration', '1', '--description', 'broken.twist'], 'not well-formed'),
    (['mbot', '--duration', '1', '--description', 'empty.urdf'], 'no links'),
    (['mbot', '--duration', '1', '--description', 'laughs.urdf'], 'laughs.urdf:1: defines'),
    (['mbot', '--duration', '1', '--description', '/dev/zero'], '/dev/zero: is a device'),
    (['mbot', '--duration', '1', '--description', 'brick.urdf'], 'no two driven wheels'),
    (['mbot', '--duration', '1', '--preset', 'piano'], 'piano'),
    (['mbot', '--duration', '1', '--ros-args', '-p', 'friction:=0.1'], 'or say --friction'),
    (['mbot', '--duration', '1', '--report', 'no/such/folder/r.json'], '--report'),
    (['mbot', '--duration', '1', '--record', 'no/such/folder/r.mcap'], '--record no/such'),
    (['mbot', '--duration', '1', '--record', '/dev/full'], 'No space left'),
    (['mbot', '--duration', '1', '--package-path', 'nowhere'], '--package-path nowhere'),
    (['mbot', '--duration', '1', '--ros-args', '-p', 'bad'], "rule: '-p bad'"),
    (['mbot', '--duration', '1', '--ros-args', '-p', 'use_sim_time:=1'], "expecting type 'BOOL'"),
    (['demo', 'go2', '--only', 'stairs'], 'demo go2 takes no other words'),
    (['demo', '--output', 'here', 'go2'], 'demo go2 takes no other words'),
    (['demo', '--ros-args', '-r', 'a:=b'], 'demo takes no --ros-args; go2, mbot, g1 do'),
    (['demo', '--output', 'broken.twist'], '--output'),
]


@pytest.fixture
def files(tmp_path: Path) -> None:
    """Write files that are wrong, each in its way."""
    (tmp_path / 'broken.keys').write_text('0.5 i\n\nsoon i\n')
    (tmp_path / 'broken.twist').write_text('0 0.5 0 0\n1 fast\n')
    (tmp_path / 'empty.urdf').write_text('<robot name="empty"><mbot_base/></robot>')
    (tmp_path / 'laughs.urdf').write_text(
        '<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]><robot name="&b;"/>'
    )
    (tmp_path / 'brick.urdf').write_text(
        '<robot name="brick"><link name="base"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>'
    )


@pytest.mark.usefixtures('files')
@for_all(('arguments', 'said'), MISTAKES)
def test_a_mistake_is_said_in_one_line(wasd: Wasd, arguments: list[str], said: str) -> None:
    done = wasd(*arguments)
    assert done.returncode == 2
    lines = [line for line in done.stderr.splitlines() if not line.startswith('[')]
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith('error: ')
    assert said in lines[0]


def test_without_a_terminal_it_says_what_to_give_instead(wasd: Wasd) -> None:
    done = wasd('mbot')
    assert done.returncode == 2
    assert done.stderr.startswith('error: no terminal for the keys: give --play FILE')
    assert len(done.stderr.splitlines()) == 1


def test_a_taken_port_is_said_in_one_line(wasd: Wasd) -> None:
    with socket.create_server(('127.0.0.1', 0)) as server:
        port = server.getsockname()[1]
        done = wasd('mbot', '--viewer', 'web', '--port', str(port), '--duration', '1')
    lines = [line for line in done.stderr.splitlines() if not line.startswith('[')]
    assert done.returncode == 2
    assert len(lines) == 1, done.stderr
    assert str(port) in lines[0]


def test_a_native_window_needs_a_display(wasd: Wasd, environment: dict[str, str]) -> None:
    environment.pop('DISPLAY', None)
    environment.pop('WAYLAND_DISPLAY', None)
    done = wasd('mbot', '--viewer', 'native', '--duration', '1')
    assert done.returncode == 2
    assert 'no display' in done.stderr


def test_help_names_every_option(wasd: Wasd) -> None:
    done = wasd('mbot', '--help')
    assert done.returncode == 0
    options = 'viewer description package-path world preset play twist push duration speed seed'
    for option in options.split():
        assert f'--{option}' in done.stdout
