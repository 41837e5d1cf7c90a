# SPDX-License-Identifier: Apache-2.0
"""A robot has a command of its own by a row in ROBOTS, and by nothing else."""

import json
from pathlib import Path
from typing import Any

import pytest
from robot_description.sensor_tags import why_broken
from teleop_keyboard.keymap_file import preset_names
from wasd_bringup.cli import main
from wasd_bringup.robots import BOTH, RobotRow, ROBOTS, WHEELED
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run
from wasd_core.parameter_file import read_mapping

from robot_description import sensor_tags

pytestmark = pytest.mark.slow

TUG = RobotRow(
    name='tug',
    kind=WHEELED,
    summary='pull trolleys',
    description='mbot_kinect',
    preset='wasd',
    examples=(('tug --world room', 'around the pillars'),),
)


@pytest.fixture
def tug(monkeypatch: pytest.MonkeyPatch) -> RobotRow:
    """A robot more."""
    monkeypatch.setitem(ROBOTS, 'tug', TUG)
    return TUG


def helped(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Return what is printed by words that end in --help."""
    with pytest.raises(SystemExit) as left:
        main(words)
    assert left.value.code == 0
    return capsys.readouterr().out


def test_the_legged_robot_is_named_first(capsys: pytest.CaptureFixture[str]) -> None:
    text = helped(['--help'], capsys).partition('COMMAND')[2]
    assert 0 < text.index('drive the legged robot') < text.index('drive the wheeled robot')


def test_a_row_is_a_command_with_help(tug: RobotRow, capsys: pytest.CaptureFixture[str]) -> None:
    assert 'pull trolleys' in helped(['--help'], capsys)
    text = helped(['tug', '--help'], capsys)
    assert text.partition('Pull trolleys.')[2]
    assert 'wasd tug --world room  around the pillars' in text
    assert 'keys of tug, --preset wasd' in text
    assert '--mode' in text
    assert '--estimator' not in text


@pytest.mark.parametrize(
    ('preset', 'layout'), [*((name, 'qwerty') for name in preset_names()), ('wasd', 'azerty')]
)
def test_the_help_of_a_quadruped_gives_no_key_of_the_keymap_another_meaning(
    preset: str, layout: str
) -> None:
    run = Run(RunOptions(robot='go2', description='go2', preset=preset, layout=layout, speed=0.0))
    keymap = run.robot.logic.keymap
    ours = '   '.join(run.robot.help_lines[len(keymap.help_lines) : -1]).split('   ')
    run.close()
    assert {'2 stand', '1 passive', '0 9 8 tests'} <= set(ours)
    assert not {part.split()[0] for part in ours} & set(keymap.keys)


def test_a_robot_without_a_place_is_not_among_those_that_share_a_world(tug: RobotRow) -> None:
    several = RunOptions(robot=BOTH, description=BOTH).per_robot()
    assert [part.robot for part in several] == ['go2', 'mbot']
    ROBOTS['tug'] = RobotRow(**{**vars(TUG), 'place': (1.0, 0.0)})
    (*_, last) = RunOptions(robot=BOTH, description=BOTH).per_robot()
    assert (last.robot, last.description, last.preset) == ('tug', 'mbot_kinect', 'wasd')


def test_a_row_drives(
    tug: RobotRow, tmp_path: Path, isolated_ros: None, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'script').write_text('0.2 w*20\n')
    report = tmp_path / 'report.json'
    words = f'tug --play {tmp_path}/script --speed 0 --viewer none --report {report}'
    assert main(words.split()) == 0
    assert 'tug at ' in capfd.readouterr().out
    result = json.loads(report.read_text())
    assert result['robot'] == 'tug'
    assert result['samples']['position'][-1][0] > 0.1


def test_a_drives_file_is_read_once(
    tmp_path: Path, isolated_ros: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = []

    def count(path: str, *rest: Any) -> Any:
        read.append(path)
        return read_mapping(path, *rest)

    monkeypatch.setattr('diff_drive_sim.controller_file.read_mapping', count)
    file = tmp_path / 'drive.yaml'
    file.write_text('linear.x.max_velocity: 0.2\n')
    (tmp_path / 'script').write_text('0 1 0 0\n')
    report = tmp_path / 'report.json'
    words = f'mbot --controller {file} --twist {tmp_path}/script --speed 0 --report {report}'
    assert main([*words.split(), '--viewer', 'none', '--duration', '0.5']) == 0
    assert json.loads(report.read_text())['samples']['command'][-1][0] == 0.2
    assert read == [str(file)]


def test_a_robots_sensors_are_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    read = []

    def count(kind: str, find: Any) -> str:
        read.append(kind)
        return why_broken(kind, find)

    monkeypatch.setattr(sensor_tags, 'why_broken', count)
    run = Run(RunOptions(robot='mbot', description='mbot', preset='mbot', map='', guard=True))
    assert len(read) == len(run.robots[0].sensors.tags)
    run.close()


def test_describe_tells_of_robots_too_and_a_file_is_no_command(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(['describe', 'info', 'mbot']) == 0
    assert 'diff-drive' in capsys.readouterr().out
    assert main(['dog.urdf']) == 2
    said = capsys.readouterr().err
    for words in ('go2', 'mbot'):
        assert f' {words} --description dog.urdf' in said
    assert 'describe info dog.urdf' in said
    assert len(said.splitlines()) == 1
