# SPDX-License-Identifier: Apache-2.0
"""What the `wasd` command says of itself before anything runs."""

import errno
import itertools
import json
import os
from pathlib import Path
import re
import signal
from typing import Any

import numpy as np
from PIL import Image
import pytest
from robot_description.mujoco import NO_RENDERER
from wasd_bringup.cli import main
from wasd_bringup.cli.drawings import BACKGROUND, SCALE_HEIGHT
from wasd_bringup.cli.main import DEMO
from wasd_bringup.cli.parsers import examples_of
from wasd_bringup.robots import BOTH, ROBOTS
from wasd_core.errors import UserError

pytestmark = pytest.mark.slow


def said(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Return what a command prints that ends with status 0."""
    with pytest.raises(SystemExit) as left:
        main(words)
    assert left.value.code == 0
    captured = capsys.readouterr()
    assert captured.err == ''
    return captured.out


def test_alone_it_says_three_lines_whose_commands_are_understood(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main([]) == 0
    text = capsys.readouterr().out
    assert text.count('\n') == 3
    assert max(map(len, text.splitlines())) <= 88
    for words in ('demo go2', 'go2', '--help'):
        assert f'wasd {words}' in text


def test_the_go2_of_the_demo_stands_jumps_walks_and_lies_down(tmp_path: Path) -> None:
    report = tmp_path / 'report.json'
    words = ['go2', '--play', str(DEMO), '--speed', '0', '--no-ros', '--report', str(report)]
    assert main(words) == 0
    told = json.loads(report.read_text())
    assert told['falls'] in (0, [0])
    samples = told['samples']
    stand = 'fixed stand'
    assert [state for state, _ in itertools.groupby(samples['state'])] == [
        *('passive', stand, 'trotting', stand, 'jump', stand, 'trotting', stand),
        *('free stand', stand, 'lie down', 'passive'),
    ]
    position = np.array(samples['position'])
    assert np.linalg.norm(np.diff(position[:, :2], axis=0), axis=1).sum() > 3.0


def test_the_demo_draws_the_climb_by_sight_and_its_elevation(wasd: Any, tmp_path: Path) -> None:
    done = wasd('demo', '--only', 'go2_stairs', '--output', str(tmp_path), timeout=300)
    assert done.returncode == 0, done.stderr
    if NO_RENDERER not in done.stdout:
        climb = np.asarray(Image.open(tmp_path / 'go2_stairs.png').convert('RGB'), float)
        assert climb.shape == (720, 1280, 3)
        assert climb.std() > 20.0
    elevation = np.asarray(Image.open(tmp_path / 'go2_stairs_elevation.png').convert('RGB'))
    # From behind to ahead treads are higher, and so brighter; far ahead next to nothing is known.
    known = (elevation != BACKGROUND).any(axis=2)[: len(elevation) - SCALE_HEIGHT]
    luminance = elevation[: len(known)] @ (0.2126, 0.7152, 0.0722)
    means = [luminance[:, part][known[:, part]].mean() for part in np.split(np.arange(240), 6)]
    assert (np.diff(means) > -1.0).all()
    assert means[-1] > means[0] + 40.0
    assert known[:, -20:].mean() < 0.01
    told = json.loads((tmp_path / 'demo.json').read_text())
    assert [row['run'] for row in told] == ['Go2, --eyes: up stairs of 15 cm by sight']


def test_the_demo_names_its_stops_where_none_is_meant(wasd: Any, tmp_path: Path) -> None:
    done = wasd('demo', '--only', 'stars', '--output', str(tmp_path))
    assert done.returncode == 2
    assert done.stderr.count('\n') == 1
    assert 'go2_stairs' in done.stderr


def test_a_demo_that_is_cut_short_tells_of_the_stops_before_and_draws_no_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from wasd_bringup.cli import demo

    class CutRun(demo.Run):
        def run(self, stop: Any) -> None:
            if self.options.duration > 0.1:
                signal.raise_signal(signal.SIGINT)
            super().run(stop)

    whole, cut = demo.TOUR[1]._replace(duration=0.1), demo.TOUR[0]._replace(duration=0.2)
    monkeypatch.setattr(demo, 'Run', CutRun)
    monkeypatch.setattr(demo, 'choose_renderer', lambda: True)
    for tour, runs in (((cut,), []), ((whole, cut), [whole.title])):
        monkeypatch.setattr(demo, 'TOUR', tour)
        assert demo.demo_command(str(tmp_path)) == 130
        tables = [path.read_text() for path in tmp_path.glob('demo.json')]
        assert [row['run'] for table in tables for row in json.loads(table)] == runs
    assert not list(tmp_path.glob('*.png'))
    assert capsys.readouterr().err == ''


def test_a_demo_that_is_cut_short_while_it_draws_leaves_the_picture_that_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from wasd_bringup.cli import demo

    def draw_half(world: Any, viewpoint: Any, path: Path, traces: Any) -> None:
        path.write_bytes(b'half')
        raise KeyboardInterrupt

    monkeypatch.setattr(demo, 'TOUR', (demo.TOUR[0]._replace(duration=0.1),))
    monkeypatch.setattr(demo, 'choose_renderer', lambda: True)
    monkeypatch.setattr(demo, 'take_picture', draw_half)
    picture = tmp_path / f'{demo.TOUR[0].name}.png'
    picture.write_bytes(b'whole')
    with pytest.raises(KeyboardInterrupt):
        demo.demo_command(str(tmp_path))
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b'whole']


def test_a_demo_without_room_to_draw_says_so_in_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from wasd_bringup.cli import demo

    def draw(world: Any, viewpoint: Any, path: Path, traces: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(demo, 'TOUR', (demo.TOUR[0]._replace(duration=0.1),))
    monkeypatch.setattr(demo, 'choose_renderer', lambda: True)
    monkeypatch.setattr(demo, 'take_picture', draw)
    with pytest.raises(UserError, match=f'{demo.TOUR[0].name}: no picture: No space left'):
        demo.demo_command(str(tmp_path))


def test_its_help_has_three_examples(capsys: pytest.CaptureFixture[str]) -> None:
    text = said(['--help'], capsys)
    assert len(re.findall(r'^  wasd \w+', text.partition('examples:')[2], re.MULTILINE)) == 3


@pytest.mark.parametrize(('command', 'word'), [('test', '--quick'), ('lint', 'mypy')])
def test_the_clone_s_commands_have_help_as_all_have(
    command: str, word: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for ask in ('-h', '--help'):
        text = said([command, ask], capsys)
        assert f'usage: wasd {command}' in text
        assert word in text


def test_it_tells_its_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert re.fullmatch(r'wasd \d+\.\d+\.\d+\n', said(['--version'], capsys))


@pytest.mark.parametrize(
    ('robot', 'keys'),
    [
        ('go2', ['2 stand   4 trot', 'w/s forward']),
        ('mbot', ['u    i    o', 'q/z']),
        ('both', ['2 stand   4 trot', 'u    i    o', 'TAB goes']),
    ],
)
def test_the_help_of_a_run_has_examples_and_the_keys(
    robot: str, keys: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    text = said([robot, '--help'], capsys)
    for words, _ in examples_of(robot):
        assert f'  wasd {words}' in text
    for key in [*keys, '? all keys', 'BACKSPACE back to the start', 'Ctrl-C quit']:
        assert key in text


@pytest.mark.parametrize('command', ['', *ROBOTS, BOTH])
def test_every_example_is_a_command_line_that_is_understood(command: str) -> None:
    from wasd_bringup.cli import make_parser

    for words, _ in examples_of(command):
        make_parser().parse_args(words.split())


def test_what_help_and_errors_tell_to_type_is_what_the_user_types(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('WASD_CALLED', './wasd')
    assert 'usage: ./wasd go2' in said(['go2', '--help'], capsys)
    assert '  ./wasd go2 --preset wasd' in said(['go2', '--help'], capsys)
    assert '--preset NAME|FILE' in said(['mbot', '--help'], capsys)
    from wasd_bringup.cli import make_parser

    with pytest.raises(UserError, match=r'\(see: \./wasd go2 --help\)'):
        make_parser().parse_args(['go2', '--no-such-option'])


@pytest.mark.parametrize('command', [*ROBOTS, BOTH])
def test_no_line_of_help_is_wider_than_the_usual_terminal(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('COLUMNS', '80')
    assert max(map(len, said([command, '--help'], capsys).splitlines())) <= 80
