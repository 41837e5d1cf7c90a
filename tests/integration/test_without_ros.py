# SPDX-License-Identifier: Apache-2.0
"""`--no-ros`: a run loads nothing of ROS, and is the same run."""

import json
import logging
from pathlib import Path
import re
import subprocess
import sys
from typing import Any

import pytest
from wasd_bringup.cli.run_command import _make_plain_run
from wasd_bringup.run.options import RunOptions

pytestmark = pytest.mark.slow

# What draws pages and pictures, and numpy's masked arrays: 50 ms of a start.
UNSEEN = ('PIL.Image', 'mujoco.studio', 'numpy.ma', 'statistics')
# Runs `wasd` with words, and says on standard error what of ROS and of UNSEEN was loaded.
WATCHED = f"""
import sys
from wasd_bringup.cli import main
status = main(sys.argv[1:])
roots = {{name.partition('.')[0] for name in sys.modules}}
print('LOADED', *sorted(n for n in roots if n == 'rclpy' or n.endswith('_msgs')), file=sys.stderr)
print('UNSEEN', *(name for name in {UNSEEN} if name in sys.modules), file=sys.stderr)
sys.exit(status)
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


@pytest.mark.parametrize('name', RUNS)
def test_a_run_without_ros_loads_none_of_it_and_has_the_same_samples(
    name: str, new_runner: Any
) -> None:
    runner = new_runner()
    folder = runner.folder
    words, keys, twists = RUNS[name]
    command = [word.strip('"') for word in re.findall(r'"[^"]*"|\S+', words)]
    command += ['--speed', '0', '--viewer', 'none']
    for option, text in (('--play', keys), ('--twist', twists)):
        if text:
            (folder / option).write_text(text)
            command += [option, str(folder / option)]
    found = {}
    for more in ('--no-ros', ''):
        report = folder / f'{more}.json'
        whole = [*command, *more.split(), '--report', str(report)]
        # That one with ROS is found to load it is to be seen once; others share their process.
        is_watched = bool(more) or name == 'map and goal'
        done = wasd(whole, folder) if is_watched else runner(*whole)
        assert done.returncode == 0, done.stderr
        told = json.loads(report.read_text())
        robots = told.get('robots', {name: told})
        found[more] = {robot: each['samples'] for robot, each in robots.items()}
        loaded = done.stderr.partition('LOADED')[2].partition('UNSEEN')[0].split()
        assert not is_watched or bool(loaded) is not bool(more), loaded
    assert found['--no-ros'] == found['']


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
