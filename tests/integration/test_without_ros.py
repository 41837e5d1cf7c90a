# SPDX-License-Identifier: Apache-2.0
"""`--no-ros`: a run loads nothing of ROS, and is the same run."""

import json
import logging
from pathlib import Path
import re
import shlex
import subprocess
import sys
from typing import Any

import pytest
from wasd_bringup.cli.run_command import _make_plain_run
from wasd_bringup.run.options import RunOptions

pytestmark = pytest.mark.slow

# What draws pages and pictures, and numpy's masked arrays: 50 ms of a start.
UNSEEN = ('PIL.Image', 'mujoco.studio', 'numpy.ma', 'statistics')
# Runs `wasd` with words, and says on standard error what of UNSEEN was loaded.
WATCHED = f"""
import sys
from wasd_bringup.cli import main
status = main(sys.argv[1:])
print('UNSEEN', *(name for name in {UNSEEN} if name in sys.modules), file=sys.stderr)
sys.exit(status)
"""
# Runs `wasd` with all words of a list, says what of ROS is loaded, and goes on with the next list.
ONE_AFTER_THE_OTHER = """
import json, sys
from wasd_bringup.cli import main
for commands in map(json.loads, sys.argv[1:]):
    for words in commands:
        assert main(words) == 0, words
    roots = {name.partition('.')[0] for name in sys.modules}
    found = sorted(name for name in roots if name == 'rclpy' or name.endswith('_msgs'))
    print('LOADED', *found, file=sys.stderr)
"""
# Hides rclpy from who looks for it, as where it is not installed.
HIDDEN = """
import importlib.abc, sys
class Hide(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] == 'rclpy':
            raise ModuleNotFoundError(name)
import importlib.util
looked = importlib.util.find_spec
importlib.util.find_spec = lambda name, *rest: None if name == 'rclpy' else looked(name, *rest)
sys.meta_path.insert(0, Hide())
"""
RUNS = {
    'go2': ('go2 --duration 2.2', '0.1 2\n1.2 5\n', '1.3 0.5 0 0.3\n'),
    'map and goal': ('mbot --duration 4 --world flat:3 --map --goal "0.2 0.1"', '', ''),
    'both': ('both --duration 2.2', '0.1 2\n1.2 4\n1.3 w*4\n1.4 TAB i*20\n1.9 j*9\n', ''),
}


def wasd(words: list[str], folder: Path, code: str = WATCHED) -> subprocess.CompletedProcess[str]:
    """Run `wasd` in a folder."""
    command = [sys.executable, '-c', code, *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)


def test_runs_without_ros_load_none_of_it_and_have_the_same_samples(tmp_path: Path) -> None:
    commands = []
    for name, (words, *texts) in RUNS.items():
        command = [*shlex.split(words), '--speed', '0', '--viewer', 'none']
        for option, text in zip(('--play', '--twist'), texts, strict=True):
            if text:
                file = tmp_path / f'{name}{option}'
                file.write_text(text)
                command += [option, str(file)]
        commands.append([*command, '--report', name])
    without = [[*command[:-1], f'{command[-1]} plain', '--no-ros'] for command in commands]
    said = wasd([json.dumps(without), json.dumps(commands)], tmp_path, ONE_AFTER_THE_OTHER)
    assert said.returncode == 0, said.stderr
    loaded = re.findall('LOADED(.*)', said.stderr)
    assert [bool(each) for each in loaded] == [False, True], loaded
    for name in RUNS:
        plain, told = (
            json.loads((tmp_path / file).read_text()) for file in (f'{name} plain', name)
        )
        for robot, each in told.get('robots', {name: told}).items():
            assert plain.get('robots', {name: plain})[robot]['samples'] == each['samples']


def test_without_ros_too_it_is_logged_why_the_legs_let_go(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(logging.getLogger('wasd'), 'handlers', [])
    options = RunOptions(robot='go2', description='go2', preset='unitree', speed=0.0)
    run = _make_plain_run(options, None, False, [])
    run.robot.let_go()
    assert 'go2: press 2 to stand (passive: emergency stop)' in capsys.readouterr().err
    run.close()


@pytest.mark.parametrize(
    'words', ['--record run.mcap', '--foxglove', '--gamepad', '--ros-args -p speed:=1.0']
)
def test_what_needs_ros_is_refused_in_a_line(words: str, new_runner: Any) -> None:
    runner = new_runner()
    done = runner('mbot', '--no-ros', '--duration', '1', *words.split())
    assert done.returncode == 2
    option = words.split()[0]
    line = f'error: {option} needs ROS, but this run has none (--no-ros)'
    assert done.stderr.splitlines()[0] == line
    assert not list(runner.folder.iterdir())


def test_a_run_that_nobody_sees_loads_nothing_that_draws(tmp_path: Path) -> None:
    done = wasd(['mbot', '--duration', '0.1', '--speed', '0', '--viewer', 'none'], tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr.splitlines()[-1] == 'UNSEEN'


def test_where_rclpy_is_not_installed_a_run_says_so_and_is_without(tmp_path: Path) -> None:
    words = ['mbot', '--duration', '0.1', '--speed', '0', '--viewer', 'none']
    done = wasd(words, tmp_path, HIDDEN + WATCHED)
    assert done.returncode == 0, done.stderr
    assert 'wasd: runs without ROS (rclpy is not installed)' in done.stderr.splitlines()
