# SPDX-License-Identifier: Apache-2.0
"""A Go2 described elsewhere, with a mesh that is not there, walks, and what was done is said."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from robot_description.packages import share_directory

pytestmark = pytest.mark.slow

PARTS = ('base', 'hip', 'thigh', 'thigh_mirror', 'calf', 'calf_mirror', 'foot')
OUR_MESHES = 'package://example-robot-data/robots/go2_description/visuals'


@pytest.fixture(scope='module')
def description(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a go2_description as Unitree's: robot.xacro names trunk.dae, base.dae is there."""
    import trimesh

    package = tmp_path_factory.mktemp('clone') / 'robots/go2_description'
    (package / 'xacro').mkdir(parents=True)
    (package / 'meshes').mkdir()
    (package / 'package.xml').write_text('<package><name>go2_description</name></package>')
    mesh = trimesh.creation.box((0.1, 0.05, 0.05))
    for part in PARTS:
        mesh.export(package / f'meshes/{part}.dae')
    for source in (share_directory('robot_description') / 'urdf/go2').glob('*.xacro'):
        text = source.read_text().replace(OUR_MESHES, 'package://go2_description/meshes')
        (package / 'xacro' / source.name).write_text(text.replace('base.dae', 'trunk.dae'))
    return package / 'xacro/go2.urdf.xacro'


@pytest.fixture(scope='module')
def walk(new_runner: Callable[[], Any], description: Path) -> tuple[Any, dict[str, Any]]:
    """Stand up and walk ahead for 2 s; return the runner and the report."""
    runner = new_runner()
    words = ('--description', str(description), '--duration', '3.2')
    return runner, runner.report('go2', *words, play='0.1 2\n0.2 5', twist='1.2 0.5 0 0')


def test_it_walks_though_the_trunks_mesh_is_not_there(walk):
    samples = walk[1]['samples']
    assert walk[1]['falls'] == 0
    ahead = samples['position'][-1][0] - samples['position'][60][0]
    assert ahead == pytest.approx(0.85, abs=0.25)


def test_it_says_what_it_repaired_in_one_line(walk, description):
    lines = [line for line in walk[0].said.splitlines() if line.startswith('description: ')]
    (line,) = lines
    assert "'package://go2_description/meshes/trunk.dae'" in line
    assert f'near-name: using {description.parents[1]}/meshes/base.dae' in line


def test_the_report_holds_the_repair(walk, description):
    found = walk[1]['description']
    assert found['path'] == str(description)
    (mesh,) = found['meshes']
    assert (mesh['kind'], mesh['link'], mesh['use']) == ('near-name', 'base', 'visual')
    assert mesh['file'] == str(description.parents[1] / 'meshes/base.dae')
    assert len(found['repairs']) == 1


def test_strict_refuses_what_would_have_been_repaired(wasd, description):
    done = wasd('go2', '--duration', '1', '--strict', '--description', str(description))
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith(f'error: {description}: --strict: visual mesh ')
    assert 'trunk.dae' in line


def test_our_own_robot_is_strictly_as_described(new_runner):
    report = new_runner().report('go2', '--strict', '--duration', '0.1')
    assert report['description']['repairs'] == []


def test_an_argument_reaches_the_xacro_file(wasd):
    done = wasd('go2', '--duration', '1', '--xacro-arg', 'DEBUG:=maybe')
    assert done.returncode == 2
    assert 'maybe' in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_an_argument_that_is_none_is_said(wasd):
    done = wasd('go2', '--duration', '1', '--xacro-arg', 'DEBUG=true')
    assert done.stderr == 'error: --xacro-arg DEBUG=true: wanted NAME:=VALUE\n'
