# SPDX-License-Identifier: Apache-2.0
"""`describe info` says what a robot is, and draws it."""

import json
from pathlib import Path
import subprocess
import sys

from cases import for_all
import numpy as np
from PIL import Image
import pytest
from robot_description.describe_command import main
from robot_description.description import parse_description
from robot_description.mujoco import find_renderer


def info(capsys, *words):
    assert main(['info', *map(str, words), '--json']) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_the_command_says_after_its_tables_that_libraries_agree():
    words = [sys.executable, '-m', 'robot_description.describe_command', 'info', 'go2', '--check']
    done = subprocess.run(words, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, '')
    last = [line.partition(':')[0] for line in done.stdout.splitlines()[-3:]]
    assert last == ['MuJoCo', 'Pinocchio', 'yourdfpy']


@pytest.mark.slow
@for_all(('name', 'kind'), [('go2', 'quadruped'), ('mbot', 'diff-drive')])
def test_the_kind_of_a_robot_is_told(capsys, name, kind):
    """It follows from its tree, see test_any_robot.py."""
    assert info(capsys, name)['kind'] == kind


def test_a_world_without_a_robot_is_none():
    world = '<robot name="r"><link name="world"/></robot>'
    assert parse_description(world, Path('world.urdf')).kind == 'other'


@pytest.mark.slow
def test_json_has_the_tree_masses_limits_and_meshes(capsys):
    found = info(capsys, 'go2')
    assert found['mass'] == pytest.approx(16.086)
    assert (found['root'], found['floating']) == ('base', True)
    assert sum(link['mass'] for link in found['links']) == pytest.approx(found['mass'])
    joints = {joint['name']: joint for joint in found['joints']}
    assert sum(joint['type'] == 'revolute' for joint in joints.values()) == 12
    calf = joints['FL_calf_joint']
    assert (calf['parent'], calf['child']) == ('FL_thigh', 'FL_calf')
    assert (calf['lower'], calf['upper'], calf['effort']) == (-2.7227, -0.83776, 35.55)
    assert joints['FL_foot_joint']['lower'] is None
    assert {mesh['kind'] for mesh in found['meshes']} == {'exact'}
    assert found['repairs'] == []


@pytest.mark.slow
def test_the_text_has_every_link_joint_and_mesh(capsys):
    assert main(['info', 'go2']) == 0
    said = capsys.readouterr().out
    assert 'quadruped, 16.086 kg, floats, root base' in said
    for word in ('RR_calf', 'RR_foot_joint', '-2.723 rad', '35.55 N m', 'visuals/base.dae'):
        assert word in said


def test_what_was_repaired_and_what_is_missing_is_said(capsys, make_package, tmp_path):
    package = make_package(tmp_path / 'dog', 'm/base.stl')
    visual = '<visual><geometry><mesh filename="package://dog/m/{}.stl"/></geometry></visual>'
    (package / 'dog.urdf').write_text(
        f'<robot name="dog"><link name="a">{visual.format("trunk")}{visual.format("hat")}</link>'
        '</robot>'
    )
    meshes = info(capsys, package / 'dog.urdf')['meshes']
    assert [mesh['kind'] for mesh in meshes] == ['near-name', 'missing']
    main(['info', str(package / 'dog.urdf')])
    said = capsys.readouterr().out
    assert 'near-name' in said
    assert 'hat.stl' in said
    assert 'left out' in said


@pytest.mark.slow
def test_a_robot_that_hangs_says_so(capsys):
    found = info(capsys, 'go2', 'DEBUG:=true')
    assert (found['kind'], found['floating']) == ('quadruped', False)


@pytest.mark.slow
def test_three_libraries_are_compared_on_request(capsys):
    found = info(capsys, 'mbot', '--check')['kinematics']
    assert [row['library'] for row in found] == ['MuJoCo', 'Pinocchio', 'yourdfpy']
    assert all(row['distance'] < 1e-6 for row in found)


def test_a_robot_without_masses_can_be_checked(capsys, tmp_path):
    path = tmp_path / 'bare.urdf'
    path.write_text(
        '<robot name="bare"><link name="base"/><link name="wheel"/>'
        '<joint name="axle" type="continuous"><parent link="base"/><child link="wheel"/>'
        '<origin xyz="1 2 3"/><axis xyz="0 1 0"/></joint></robot>'
    )
    pytest.importorskip('yourdfpy')
    record = info(capsys, path, '--check')
    assert record['mass'] == 0.0
    assert (record['joints'][0]['effort'], record['joints'][0]['velocity']) == (None, None)
    assert all(row['distance'] < 1e-6 for row in record['kinematics'])


# What mujoco renders with is chosen when it is first imported.
DRAW = """
import sys
from robot_description.describe_command import main
print(*(main(['info', 'mbot', '--picture', path]) for path in sys.argv[1:]))
"""


@pytest.mark.slow
@pytest.mark.skipif(find_renderer() is None, reason='neither EGL nor OSMesa here')
def test_a_picture_shows_the_robot_and_one_that_cannot_be_written_is_one_line(tmp_path):
    paths = [tmp_path / name for name in ('mbot.png', 'nowhere/mbot.png', 'mbot.xyz')]
    words = [sys.executable, '-c', DRAW, *map(str, paths)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.stdout.splitlines()[-1] == '0 2 2'
    assert done.stderr == (
        f'error: --picture {paths[1]}: wanted a file in a folder that exists\n'
        f'error: --picture {paths[2]}: wanted FILE.png\n'
    )
    pixels = np.asarray(Image.open(paths[0]).convert('RGB')).astype(int)
    # mbot's drum is orange, the sky is not.
    orange = (pixels[..., 0] > pixels[..., 2] + 60).mean()
    assert 0.05 < orange < 0.6
