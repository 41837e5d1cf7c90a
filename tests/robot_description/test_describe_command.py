# SPDX-License-Identifier: Apache-2.0
import json

import pytest
from robot_description.describe_command import main


def test_expand_prints_the_urdf(capsys):
    assert main(['expand', 'mbot']) == 0
    assert '<link name="left_wheel_link">' in capsys.readouterr().out


def test_xacro_arguments_may_stand_anywhere(capsys, tmp_path):
    main(['expand', 'DEBUG:=true', 'go2', '--output', str(tmp_path / 'go2.urdf')])
    assert '<link name="world"/>' in (tmp_path / 'go2.urdf').read_text()
    assert capsys.readouterr().out == ''


def test_info_tells_the_mass(capsys):
    assert main(['info', 'mbot']) == 0
    assert '1.800 kg' in capsys.readouterr().out


def test_info_prints_json_on_request(capsys):
    assert main(['info', 'mbot', '--json']) == 0
    assert json.loads(capsys.readouterr().out)['root'] == 'base_footprint'


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        ([], 'COMMAND'),
        (['fly'], "invalid choice: 'fly'"),
        (['info'], 'PATH'),
        (['info', 'mbot', 'go2'], 'unrecognized arguments: go2'),
        (['info', 'mbot', '--colour'], 'unrecognized arguments: --colour'),
        (['info', 'nowhere.urdf'], 'nowhere.urdf: no such file'),
        (['info', 'mbot', '--package-path', 'nowhere'], 'nowhere: no such folder'),
        (['expand', 'mbot', '--output', '/no/such/folder/x'], '/no/such/folder/x: No such file'),
    ],
)
def test_a_mistake_is_one_line_and_status_2(words, said, capsys):
    assert main(words) == 2
    line = capsys.readouterr().err
    assert said in line
    assert line.startswith('error: ')
    assert line.count('\n') == 1
