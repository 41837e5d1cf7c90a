# SPDX-License-Identifier: Apache-2.0
"""A run of the benchmark is the same in its process, as a command, and in any other process."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
import pytest
from robot_description.packages import share_directory
from wasd_core.extras import install_line

BENCHMARKS = Path(__file__).parents[2] / 'benchmarks'


@pytest.fixture(scope='module')
def run(bench: Any) -> Any:
    """Return a short run with all that is untold: it stands up, walks and is pushed."""
    return bench('trials').Run(
        seed=3,
        keys='0.1 2\n2.2 5\n',
        twist='2.3 0.7 0.1 0.3\n2.7 stop\n',
        duration=2.9,
        world='boxes:0.05',
        push='2.5 0 100 0 0.1 0.1 0 0',
        friction=0.5,
        payload='2@0,0.1,0',
        randomise=0.5,
    )


@pytest.fixture(scope='module')
def trace(bench: Any, run: Any) -> Any:
    """Return what happened in it, in this process."""
    return bench('trials').simulate(run)


COLUMNS = ('t', 'position', 'rpy', 'velocity', 'odometry', 'contacts', 'torque')


@pytest.mark.slow
def test_it_is_what_the_command_reports(bench: Any, run: Any, trace: Any) -> None:
    command = bench('trials').simulate(replace(run, command=True))
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(trace, name), getattr(command, name), name)
    assert trace.state == command.state
    assert trace.report['falls'] == command.report['falls']


@pytest.mark.slow
def test_on_all_cores_the_figures_are_those_of_one_by_one(
    bench: Any, run: Any, trace: Any
) -> None:
    runs = [run, replace(run, seed=4, world='flat', duration=0.5)]
    said: list[str] = []
    results = bench('cores').simulate_all([*runs, run], said.append)
    assert set(results) == set(runs)
    assert results[run].digest == trace.digest
    assert len(said) == len(runs)


@pytest.mark.slow
def test_a_run_that_breaks_breaks_no_other(bench: Any, run: Any) -> None:
    result = bench('cores').attempt(replace(run, world='moon'))
    assert isinstance(result, bench('trials').RunFailed)
    assert 'no such file' in str(result)


@pytest.mark.slow
def test_on_a_cluster_the_figures_are_the_same(
    bench: Any, run: Any, trace: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    distributed = pytest.importorskip('distributed')
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=':0'
    ) as own:
        monkeypatch.setattr(bench('cores'), 'cluster', own.scheduler_address)
        results = bench('cores').simulate_all([run], lambda _: None)
    assert results[run].digest == trace.digest


def test_the_cluster_is_loaded_only_when_it_is_asked_for() -> None:
    for path in BENCHMARKS.glob('*.py'):
        at_top = [line for line in path.read_text().splitlines() if not line.startswith(' ')]
        assert not any('distributed' in line and 'import' in line for line in at_top), path


@pytest.mark.slow
def test_without_the_extra_a_cluster_is_refused_in_a_line(
    bench: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run = bench('run')
    monkeypatch.setattr(run.importlib.util, 'find_spec', lambda name: None)
    monkeypatch.setattr('sys.argv', ['bench', 'legs', '--dask', 'tcp://10.0.0.1:8786'])
    assert run.main() == 2
    assert f'--dask needs: {install_line("cluster")} (see' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        (['legs', '--only', 'flying'], "--only 'flying': no row of legs has that in its name"),
        (['mbot', '--only', 'stairs'], '--only is of legs and of sight'),
        (['mbot', '--description', 'dog.urdf'], '--description is of quadrupeds, not of mbot'),
        (['quadrupeds', '--description', 'no/dog.urdf'], 'no/dog.urdf: no such file'),
        (['flying'], "invalid choice: 'flying'"),
        (['policy', 'nowhere.onnx'], 'nowhere.onnx: no such file'),
        (['mbot', '--json', 'no/where.json'], '--json no/where.json: wanted a file in a folder'),
    ],
)
def test_what_cannot_be_measured_is_refused_in_a_line_before_it_begins(
    bench: Any,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    said: str,
) -> None:
    monkeypatch.setattr('sys.argv', ['bench', *words])
    assert bench('run').main() == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith('error: ')
    assert said in line


@pytest.mark.slow
def test_the_sensors_of_mbot_are_measured(bench: Any) -> None:
    assert bench('mbot_accuracy').sensors(3)[0].passed


@pytest.mark.slow
def test_robots_whose_files_have_one_name_have_rows_of_their_own(
    bench: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    quadrupeds = bench('quadrupeds')
    a1 = share_directory('example-robot-data') / 'robots' / quadrupeds.ROBOTS['a1']
    paths = [str(tmp_path / name / 'dog.urdf') for name in ('one', 'other')]
    for path in map(Path, paths):
        path.parent.mkdir()
        path.write_text(a1.read_text())
    monkeypatch.setattr(quadrupeds, 'more', paths)
    monkeypatch.setattr(quadrupeds, 'ROBOTS', {})
    failed = bench('trials').RunFailed('not today')
    monkeypatch.setattr(quadrupeds, 'simulate_all', lambda runs, note: dict.fromkeys(runs, failed))
    rows = quadrupeds.measure(True, str)
    for path in paths:
        assert sum(path in row.what for row in rows) == 2


def test_rows_of_the_legs_are_chosen_by_their_names(bench: Any) -> None:
    legs = bench('legs')
    chosen = [part.what for part in legs.experiments(True, 'stairs of 12', 'jump: in', 'jump: ah')]
    assert chosen == ['blind at 0.5 m/s: stairs of 12 cm', 'jump: in place', 'jump: ahead']
    assert len(legs.experiments(True)) > len(chosen)


def test_every_gait_has_a_row(bench: Any) -> None:
    from quadruped_sim.presets import GAITS

    legs = bench('legs')
    rows = {experiment.what for experiment in legs.on_the_flat(legs.QUICK)}
    assert {f'gait {name}, {speed:g} m/s' for name, speed in legs.GAIT_SPEEDS.items()} <= rows
    assert legs.GAIT_SPEEDS.keys() == GAITS.keys()


def test_a_payload_is_judged_beside_a_robot_that_walks(bench: Any) -> None:
    """Two that fall alike, or one that falls without a load, show nothing."""
    speed = bench('legs_speed')

    class Fallen:
        is_up = False

        def mean_velocity(self, start: float) -> tuple[float, ...]:
            return (1.0, 1.0, 1.0)

        def record(self, passed: bool, **figures: Any) -> dict[str, Any]:
            return {'passed': passed, **figures}

    experiment = speed.loaded('8@0,0.1,0', 35.0, 1)
    verdict = experiment.judge([Fallen()] * len(experiment.runs))
    assert not verdict.passed


@pytest.mark.slow
def test_the_picture_of_success_counts_who_comes_through(
    bench: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    success = bench('success')

    def slip(size: float, index: int, count: int) -> Any:
        return replace(success.slip(size, index, count), duration=success.START + 1.6)

    def simulate_here(runs: list[Any], note: Any) -> dict[Any, Any]:
        return {run: bench('cores').attempt(run) for run in runs}

    panels = (success.Panel('friction of the feet', '', (0.02, 0.6), slip, 0.2),)
    monkeypatch.setattr(success, 'PANELS', panels)
    monkeypatch.setattr(success, 'simulate_all', simulate_here)
    words = success.draw_success(tmp_path / 'success.png', 1, 1, lambda _: None)
    assert words == 'friction of the feet: 0.02: 0/1, 0.6: 1/1'
    with Image.open(tmp_path / 'success.png') as picture:
        red, _, blue = np.array(picture.convert('RGB'), dtype=int).reshape(-1, 3).T
    assert success.RATE[2] > success.RATE[0] + 100
    assert (blue > red + 100).sum() > 100


@pytest.mark.parametrize(
    ('words', 'is_drawn'),
    [(['legs'], True), ([], True), (['legs', '--quick'], False), (['mbot'], False)],
)
def test_the_legs_measured_whole_are_drawn_where_the_page_shows_them(
    bench: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, words: list[str], is_drawn: bool
) -> None:
    run, page, drawn = bench('run'), bench('page'), []

    def draw(path: Path, *_: Any) -> str:
        drawn.append(path)
        return ''

    monkeypatch.setattr(run, 'measure', lambda *_: [])
    monkeypatch.setattr(run, 'describe_machine', lambda: 'a machine')
    monkeypatch.setattr(run, 'draw_success', draw)
    monkeypatch.setattr(page, 'write', lambda _: None)
    result = ['--json', str(tmp_path / 'result.json')]
    monkeypatch.setattr('sys.argv', ['bench', *words, '--write', *result])
    assert run.main() == 0
    assert drawn == [page.DOCS / page.SUCCESS] * is_drawn


def test_what_was_measured_is_kept_when_the_picture_after_it_is_interrupted(
    bench: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    run, page = bench('run'), bench('page')

    def interrupt(*_: Any) -> str:
        raise KeyboardInterrupt

    row = bench('table').Row(what='new', measured='1', must='1', passed=True)
    monkeypatch.setattr(page, 'RESULT', tmp_path / 'numbers.json')
    monkeypatch.setattr(page, 'PAGE', tmp_path / 'numbers.md')
    monkeypatch.setattr(run, 'PARTS', {'legs': None})
    monkeypatch.setattr(run, 'measure', lambda *_: [row])
    monkeypatch.setattr(run, 'describe_machine', lambda: 'a PC')
    monkeypatch.setattr(run, 'draw_legs', interrupt)
    monkeypatch.setattr('sys.argv', ['bench', '--write', f'--json={tmp_path}/all.json'])
    with pytest.raises(KeyboardInterrupt):
        run.main()
    assert [row['what'] for row in page.last_result()['rows']] == ['new']
    assert '| new |' in page.PAGE.read_text()


def test_rows_measured_again_are_written_in_their_place_with_who_measured_them(
    bench: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    run, page = bench('run'), bench('page')

    def rows(**measured: str) -> list[Any]:
        row = bench('table').Row
        return [
            row(what=f'legs: {a}', measured=b, must='', passed=True) for a, b in measured.items()
        ]

    def write(found: list[Any], *words: str) -> dict[str, str]:
        monkeypatch.setattr(run, 'measure', lambda *_: found)
        monkeypatch.setattr(
            'sys.argv', ['bench', *words, '--write', f'--json={tmp_path}/all.json']
        )
        assert run.main() == 0
        return {row['what'][6:]: row['measured'] for row in page.last_result()['rows']}

    monkeypatch.setattr(page, 'RESULT', tmp_path / 'numbers.json')
    monkeypatch.setattr(page, 'PAGE', tmp_path / 'numbers.md')
    monkeypatch.setattr(run, 'PARTS', {'legs': None})
    monkeypatch.setattr(run, 'describe_machine', lambda: 'a PC')
    monkeypatch.setattr(run, 'draw_legs', lambda *_: 'drawn')
    assert write(rows(a='1', b='2')) == {'a': '1', 'b': '2'}
    some = ('legs', '--only', 'random keys')
    assert list(write(rows(b='3', c='4'), *some).items()) == [('a', '1'), ('b', '3'), ('c', '4')]
    said = 'Of `./wasd bench legs --only ...` ('
    assert said in page.PAGE.read_text()
    assert 'a PC) are: legs: b; legs: c.' in page.PAGE.read_text()
    # All of them measured again: none is of another run.
    assert write(rows(a='5', c='6'), 'legs') == {'a': '5', 'c': '6'}
    assert said not in page.PAGE.read_text()
