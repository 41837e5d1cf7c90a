# SPDX-License-Identifier: Apache-2.0
"""An option that is given what it cannot use says so in one line, whatever that is."""

import itertools
import json
import os
from pathlib import Path
import shutil
import subprocess
import sys

from cases import for_all
import pytest
from terminals import PATIENCE
from wasd_bringup.cli import main
from wasd_bringup.cli.options import OPTIONS

pytestmark = pytest.mark.slow

RUN = ('--duration', '0.1', '--speed', '0', '--viewer', 'none')
PATHS = ('--description', '--world', '--map', '--controller', '--preset', '--package-path')
SCRIPTS = ('--play', '--twist')
NUMBERS = (
    '--duration',
    '--speed',
    '--seed',
    '--payload',
    '--friction',
    '--goal',
    '--push',
    '--box',
)
OUTPUTS = ('--report', '--record', '--save-keys', '--save-map')
# A gamepad may come later under any name, a network interface is looked for by its name.
ANY_NAME = ('--gamepad', '--network')
POLICIES = ('--policy', '--policy-config')  # see tests/policy_player/test_strangers_files.py
REST = sorted(
    {
        option.word
        for option in OPTIONS
        if 'action' not in option.how
        and option.word not in (*PATHS, *SCRIPTS, *NUMBERS, *OUTPUTS, *ANY_NAME, *POLICIES)
    }
)
OTHER_USER = 1234
WHEEL = (
    '<link name="{0}"><inertial><mass value="1"/><inertia ixx=".01" ixy="0" ixz="0" iyy=".01" '
    'iyz="0" izz=".01"/></inertial><collision><origin rpy="1.5708 0 0"/><geometry><cylinder '
    'radius=".1" length=".05"/></geometry></collision></link><joint name="{0}_joint" '
    'type="continuous"><parent link="base"/><child link="{0}"/><origin xyz="0 {1} 0"/>'
    '<axis xyz="0 1 0"/></joint>'
)
CART = f'<robot name="cart"><link name="base"/>{WHEEL.format("left_wheel", 0.2)}' + (
    f'{WHEEL.format("right_wheel", -0.2)}</robot>'
)


@pytest.fixture
def places(tmp_path: Path) -> dict[str, str]:
    """What a path may lead to that nobody meant."""
    (tmp_path / 'folder').mkdir()
    (tmp_path / 'empty').touch()
    os.mkfifo(tmp_path / 'pipe')
    found = {name: str(tmp_path / name) for name in ('folder', 'empty', 'pipe', 'nothing')}
    return {**found, 'device': '/dev/zero', 'below a file': str(tmp_path / 'empty' / 'x')}


def assert_one_line(capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    assert main(words) == 2
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1, said


@for_all('place', ['folder', 'empty', 'pipe', 'nothing', 'device', 'below a file'])
@for_all('option', PATHS)
def test_a_path_that_leads_elsewhere(option, place, places, capsys):
    if (option, place) != ('--package-path', 'folder'):  # a folder is what it wants
        assert_one_line(capsys, ['mbot', *RUN, option, places[place]])


@for_all('place', ['folder', 'nothing', 'below a file'])
@for_all('option', SCRIPTS)
def test_a_script_that_is_none(option, place, places, capsys):
    assert_one_line(capsys, ['mbot', *RUN, option, places[place]])


@for_all('value', ['nan', '-inf', '1e308 1e308', 'x', '-1e308'])
@for_all('option', NUMBERS)
def test_a_number_that_is_none_or_huge(option, value, capsys):
    assert_one_line(capsys, ['go2', *RUN, f'{option}={value}'])


@for_all('option', REST)
def test_all_other_options_know_none_of_that(option, places, capsys):
    robots = itertools.cycle(('mbot', 'go2'))  # it plays no part which
    for value in (*places.values(), 'nan', '1e308', '-1e308', 'x' * 5000):
        assert_one_line(capsys, [next(robots), *RUN, f'{option}={value}'])


# Runs what each argument asks for, and says how that ended and what was said.
EACH = """
import contextlib, io, json, sys
from wasd_bringup.cli import main
for words in map(json.loads, sys.argv[1:]):
    with contextlib.redirect_stderr(io.StringIO()) as said:
        status = main(words)
    print(json.dumps([status, said.getvalue()]))
"""


def test_a_folder_that_one_may_not_enter(tmp_path):
    forbidden = tmp_path / 'forbidden'
    forbidden.mkdir(mode=0o000)
    asked = [(option, name) for option in (*PATHS, *SCRIPTS, *OUTPUTS) for name in ('', 'x')]
    runs = [json.dumps(['mbot', *RUN, option, str(forbidden / name)]) for option, name in asked]
    words = [sys.executable, '-c', EACH, *runs]
    if os.geteuid() == 0:
        if shutil.which('setpriv') is None:
            pytest.skip('root may enter any folder')
        os.chown(forbidden, OTHER_USER, OTHER_USER)
        powers = '-dac_override,-dac_read_search'
        words = ['setpriv', f'--bounding-set={powers}', f'--inh-caps={powers}', *words]
    done = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE)
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    for (option, name), (status, said) in zip(asked, answers, strict=True):
        assert (status, len(said.splitlines())) == (2, 1), said
        if name or option == '--package-path':  # no folder is what the others want
            assert 'Permission denied' in said


@pytest.mark.parametrize('option', ['--description', '--gamepad', '--save-map'])
def test_a_name_that_is_no_utf_8_is_not_for_ros(option, wasd, tmp_path):
    path = tmp_path / '\udcff.urdf'
    path.write_text(CART)
    done = wasd('mbot', *RUN, option, str(path))
    assert done.returncode == 2, done.stderr
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert 'UTF-8, as ROS has no other' in done.stderr
    assert 'choose another name' in done.stderr


def test_a_goal_that_is_not_reached_is_told_at_the_end_where_no_terminal_shows_it(wasd):
    """It is no mistake of the command line: only the robot's map tells."""
    goal = ('--map', '--world', 'flat:3', '--goal', '99 99', '--duration', '5')
    done = wasd('mbot', *RUN, *goal, '--no-ros')
    assert done.returncode == 0, done.stderr
    told = done.stdout.splitlines()[-1]
    assert told.startswith('goal 99 99 refused: (99.00, 99.00) is outside the map'), done.stdout


@pytest.mark.parametrize(
    ('name', 'value'),
    [('ROS_DOMAIN_ID', '233'), ('ROS_DOMAIN_ID', 'x'), ('RMW_IMPLEMENTATION', 'rmw_none')],
)
def test_a_setting_of_ros_that_cannot_be(name, value, capsys, monkeypatch):
    monkeypatch.setenv(name, value)
    assert main(['mbot', *RUN]) == 2
    said = capsys.readouterr().err
    assert name in said
    assert len(said.splitlines()) == 1, said
