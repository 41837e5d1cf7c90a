# SPDX-License-Identifier: Apache-2.0
import json
import os
import subprocess
import sys

from cases import for_all
import pytest
from robot_description.describe_command import main


@pytest.mark.slow
def test_expand_prints_the_urdf(capsys):
    assert main(['expand', 'mbot']) == 0
    assert '<link name="left_wheel_link">' in capsys.readouterr().out


@pytest.mark.slow
def test_xacro_arguments_may_stand_anywhere(capsys, tmp_path):
    main(['expand', 'DEBUG:=true', 'go2', '--output', str(tmp_path / 'go2.urdf')])
    assert '<link name="world"/>' in (tmp_path / 'go2.urdf').read_text()
    assert capsys.readouterr().out == ''


@pytest.mark.slow
def test_info_warns_of_an_argument_that_the_file_does_not_have(capsys):
    assert main(['info', 'go2', 'DEBUGG:=true']) == 0
    assert "no argument 'DEBUGG' here; it has: DEBUG" in capsys.readouterr().out


@pytest.mark.slow
def test_info_tells_the_mass(capsys):
    assert main(['info', 'mbot']) == 0
    assert '1.800 kg' in capsys.readouterr().out


def test_info_prints_json_on_request(capsys):
    assert main(['info', 'mbot', '--json']) == 0
    assert json.loads(capsys.readouterr().out)['root'] == 'base_footprint'


@for_all(
    ('words', 'said'),
    [
        ([], 'COMMAND'),
        (['fly'], "invalid choice: 'fly'"),
        (['info'], 'PATH'),
        (['info', 'mbot', 'go2'], 'unrecognized arguments: go2'),
        (['info', 'mbot', '--colour'], 'unrecognized arguments: --colour'),
        (['info', 'nowhere.urdf'], 'nowhere.urdf: no such file'),
        (['info', 'mbot', '--package-path', 'nowhere'], 'nowhere: no such folder'),
        (
            ['expand', 'mbot', '--output', '/no/such/folder/x'],
            '/no/such/folder/x: wanted a file in a folder that exists',
        ),
    ],
)
def test_a_mistake_is_one_line_and_status_2(words, said, capsys):
    assert main(words) == 2
    line = capsys.readouterr().err
    assert said in line
    assert line.startswith('error: ')
    assert line.count('\n') == 1


def test_expand_does_not_write_over_a_source(tmp_path, capsys):
    path = tmp_path / 'robot.urdf'
    path.write_text('<robot name="robot"><link name="base"/></robot>')
    assert main(['expand', str(path), '--output', str(tmp_path / '.' / 'robot.urdf')]) == 2
    assert 'is a source; it is not overwritten' in capsys.readouterr().err
    assert path.read_text().startswith('<robot')


@pytest.mark.slow
@pytest.mark.parametrize('command', ['expand', 'lint', 'fix', 'info'])
def test_every_command_reads_and_writes_utf8_whatever_the_locale_is(command, tmp_path):
    path = tmp_path / os.fsdecode(b'robot\xff.urdf')
    path.write_text(
        '<robot name="robot"><link name="räder"/><link name="räder"/></robot>', encoding='utf-8'
    )
    done = subprocess.run(
        [sys.executable, '-m', 'robot_description.describe_command', command, str(path)],
        env={**os.environ, 'LC_ALL': 'C', 'PYTHONUTF8': '0', 'PYTHONCOERCECLOCALE': '0'},
        capture_output=True,
    )
    assert b'Traceback' not in done.stderr
    assert done.returncode == {'expand': 0, 'lint': 1, 'fix': 1, 'info': 2}[command]
