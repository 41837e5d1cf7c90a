# SPDX-License-Identifier: Apache-2.0
"""Each rule has a fixture that tells where it is broken, and is broken nowhere else."""

from collections import Counter
import json
from pathlib import Path
import re

from cases import for_all
import pytest
from robot_description.describe_command import main
from robot_description.lint.rules import RULES, Severity
from robot_description.lint.session import lint
from robot_description.packages import share_directory
from robot_description.xacro.session import XacroSession

FIXTURES = Path(__file__).parent / 'fixtures'
MBOT = FIXTURES / 'mbot_description/urdf'
FILES = [
    *sorted((FIXTURES / 'lint').glob('*.*')),
    MBOT / 'mbot.xacro',
    *sorted((FIXTURES / 'robots/dog_description/urdf').glob('*.urdf')),
]
EXAMPLES = share_directory('example-robot-data') / 'robots'


def announced(path):
    """Return the codes that a file says are found in it, by line."""
    return Counter(
        (number, code)
        for number, line in enumerate(path.read_text().splitlines(), 1)
        for codes in re.findall('finds: (.*?) -->', line)
        for code in codes.split()
    )


@for_all('path', FILES)
def test_it_finds_what_the_fixture_announces_and_nothing_else(path):
    found = lint(XacroSession(path))
    files = {path, *(one.place.file for one in found)}
    for file in files:
        here = Counter((one.place.line, one.rule.code) for one in found if one.place.file == file)
        assert here == announced(file), [one.line() for one in found]


def test_a_tag_that_is_misspelt_is_said_with_what_was_meant():
    found = lint(XacroSession(next(path for path in FILES if path.name == 'tags.urdf')))
    assert any('did you mean collision?' in one.message for one in found)


def test_a_joint_on_an_empty_root_may_float(tmp_path):
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    (path := tmp_path / 'free.urdf').write_text(
        f'<robot name="free"><link name="odom"/><link name="base">{body}</inertial></link>'
        '<joint name="j" type="floating"><parent link="odom"/><child link="base"/></joint></robot>'
    )
    assert not [one.line() for one in lint(XacroSession(path))]


def test_every_rule_has_a_fixture():
    codes = {code for path in [*FILES, MBOT / 'mbot_base.xacro'] for _, code in announced(path)}
    assert codes == set(RULES)


@pytest.mark.slow
@pytest.mark.parametrize('name', ['go2', 'mbot'])
def test_our_own_robots_have_no_finding(name, capsys):
    assert main(['lint', name, '--strict']) == 0
    assert capsys.readouterr().out.endswith(': no findings\n')


@pytest.mark.slow
@for_all(
    'robot',
    ['a1_description/urdf/a1.urdf', 'b1_description/urdf/b1.urdf', 'go1_description/urdf/go1.urdf',
     'laikago_description/urdf/laikago.urdf', 'ur_description/urdf/ur5_robot.urdf',
     'hyq_description/robots/hyq_no_sensors.urdf', 'talos_data/robots/talos_full_v2.urdf'],
)  # fmt: skip
def test_sound_robots_of_others_have_no_finding(robot):
    assert lint(XacroSession(EXAMPLES / robot)) == []


@pytest.mark.slow
def test_a_thigh_whose_knee_has_its_motor_there_is_no_wheel():
    found = lint(XacroSession(EXAMPLES / 'anymal_c_simple_description/urdf/anymal.urdf'))
    assert 'unbalanced-wheel' not in {one.rule.code for one in found}


def test_every_finding_is_one_line_with_a_place_and_a_cure():
    for one in lint(XacroSession(FIXTURES / 'lint/masses.urdf')):
        assert re.fullmatch(r'\S+masses\.urdf:\d+: (error|warning): .+; cure: .+', one.line())


def test_errors_make_the_status_1(capsys):
    assert main(['lint', str(FIXTURES / 'lint/cycle.urdf')]) == 1
    assert '[cycle]' in capsys.readouterr().out


@for_all(('options', 'status'), [([], 0), (['--strict'], 1)])
def test_warnings_make_the_status_1_under_strict(options, status):
    assert main(['lint', str(FIXTURES / 'lint/robot-name.urdf'), *options]) == status


def test_infos_never_do():
    assert main(['lint', str(FIXTURES / 'lint/arbotix-joint-name.urdf'), '--strict']) == 0


def test_json_has_code_severity_file_line_message_and_cure(capsys):
    path = FIXTURES / 'lint/orphan-link.urdf'
    assert main(['lint', str(path), '--json']) == 1
    (record,) = json.loads(capsys.readouterr().out)
    assert record == {
        'code': 'orphan-link',
        'severity': 'error',
        'file': str(path),
        'line': 6,
        'message': "no joint mentions link 'lost_link'",
        'cure': 'connect it by a joint, or remove it',
    }


def test_a_file_that_is_not_there_is_status_2(capsys):
    assert main(['lint', 'nowhere.urdf']) == 2
    assert 'nowhere.urdf' in capsys.readouterr().err


def test_a_name_that_a_controller_expects_gets_the_rename(capsys):
    assert main(['lint', 'mbot', '--expect', 'base_l_wheel_joint']) == 1
    said = capsys.readouterr().out
    assert "'left_wheel_joint' is" in said
    assert 'describe fix --rename left_wheel_joint:=base_l_wheel_joint' in said


@pytest.mark.slow
def test_xacro_arguments_count(tmp_path):
    path = tmp_path / 'robot.xacro'
    path.write_text(
        '<robot name="robot" xmlns:xacro="http://www.ros.org/wiki/xacro">'
        '<xacro:arg name="y" default="0.1"/><link name="base"/><link name="l"/><link name="r"/>'
        '<joint name="left_joint" type="fixed"><origin xyz="0 $(arg y) 0"/><parent link="base"/>'
        '<child link="l"/></joint>'
        '<joint name="right_joint" type="fixed"><origin xyz="0 ${-float(xacro.arg(\'y\'))} 0"/>'
        '<parent link="base"/><child link="r"/></joint></robot>'
    )
    assert lint(XacroSession(path)) == []
    assert [one.rule.code for one in lint(XacroSession(path, {'y': '-0.1'}))] == ['swapped-sides']


def test_the_page_lists_the_rules_as_they_are():
    page = (Path(__file__).parents[2] / 'docs/lint.md').read_text()
    order = list(Severity)
    rules = sorted(RULES.values(), key=lambda rule: order.index(rule.severity))
    rows = [f'| `{r.code}` | {r.severity} | {r.meaning} | {r.cure} |' for r in rules]
    head = ['| code | severity | what it means | cure |', '|---|---|---|---|']
    assert '\n'.join([*head, *rows]) in page


@for_all('root', ['svg', 'Robot', 'u:robot'])
def test_a_file_whose_first_tag_is_no_robot_is_refused_by_name(root, tmp_path, capsys):
    path = tmp_path / 'other.urdf'
    path.write_text(f'<{root} xmlns:u="urdf" name="r" radius="x"><link name="a"/></{root}>')
    for command in ('lint', 'fix'):
        assert main([command, str(path)]) == 1
        lines = ''.join(capsys.readouterr())
        assert f'other.urdf:1: error: is <{root}>, wanted URDF or xacro [not-readable]' in lines
    for command in ('info', 'expand'):
        assert main([command, str(path)]) == 2
        assert f'other.urdf:1: is <{root}>, wanted' in capsys.readouterr().err


@pytest.mark.slow
def test_what_only_loading_refuses_is_an_error(tmp_path, capsys):
    links = ''.join(f'<link name="l{i}"/>' for i in range(500))
    joints = ''.join(
        f'<joint name="j{i}" type="fixed"><parent link="l{i}"/><child link="l{i + 1}"/></joint>'
        for i in range(499)
    )
    path = tmp_path / 'chain.urdf'
    path.write_text(f'<robot name="chain">{links}{joints}</robot>')
    assert main(['lint', str(path)]) == 1
    assert '500 links hang on each other' in capsys.readouterr().out
