# SPDX-License-Identifier: Apache-2.0
"""A sourced ROS 2 Jazzy, an empty home, the lines of docs/install.md: everything runs."""

import os
from pathlib import Path
import signal
import subprocess
import xml.etree.ElementTree as ElementTree

from executables import SCRIPTS
import pytest
from rclpy.node import Node
from sourced_jazzy import FROM_APT, ROOT
from terminals import PATIENCE

pytestmark = [pytest.mark.slow, pytest.mark.takes_up_to(3600.0)]

EXECUTABLES = {name: target.partition('.')[0] for name, target in SCRIPTS.items()}
PACKAGES = sorted(path.parent.name for path in ROOT.glob('*/package.xml'))
SOURCED = '. ~/ros2_ws/install/setup.bash; '
MODULES = (
    'PIL collada daqp fast_simplification mcap mujoco numba numpy pinocchio rich trimesh xacro '
    'yaml rclpy'
)
IMPORT = f"""
import importlib
for name in '{MODULES}'.split():
    print(name, importlib.import_module(name).__file__)
import numpy; print('version', numpy.__version__)
"""
PUBLISHED = """
from robot_description.description import read_description
from robot_description.meshes.files import opened_by_rviz, published_urdf
from robot_description.packages import description_path
from robot_description.urdf import parse_urdf
read = read_description(description_path('go2'))
shapes = [s for l in parse_urdf(published_urdf(read.urdf, read.meshes.files)).links.values()
          for s in l.visuals if s.kind == 'mesh']
print(len(shapes), [s.url for s in shapes if opened_by_rviz(s.url) is None], read.repairs)
"""
PLAYED = {'go2': '0.1 2\n1 4\n1.5 w*4', 'mbot': '0.1 i*30'}


def test_the_lines_bring_every_import_and_leave_the_numpy_of_jazzy_alone(jazzy):
    done = jazzy.run(SOURCED + 'python3 -c "$1"', IMPORT)
    assert done.returncode == 0, done.stderr
    found = dict(line.split(' ') for line in done.stdout.splitlines())
    assert f'numpy=={found["version"]}' == FROM_APT['python3-numpy']
    assert Path(found['rclpy']).is_relative_to(jazzy.prefix)
    assert Path(found['mujoco']).is_relative_to(jazzy.home / '.local')


def test_the_meshes_of_the_go2_are_found_by_us_and_by_rviz(jazzy):
    done = jazzy.run(SOURCED + 'python3 -c "$1"', PUBLISHED)
    assert (done.returncode, done.stdout) == (0, '17 [] ()\n'), done.stderr


# `ros2 run` starts the file of that name in lib/PACKAGE of the package's prefix. The others are
# commands, or speak Unitree's DDS.
NODES = sorted(set(EXECUTABLES) - {'describe', 'unitree_bridge', 'wasd'})


@pytest.mark.parametrize('executable', NODES)
def test_a_node_runs_until_ctrl_c(executable, jazzy, workspace, isolated_ros, spawn, spin_until):
    package = EXECUTABLES[executable]
    script = workspace / 'install' / package / 'lib' / package / executable
    name = f'as_{executable}_{isolated_ros}'
    master, terminal = os.openpty()
    words = ['bash', '-c', SOURCED + 'exec "$0" "$@"', str(script)]
    process = subprocess.Popen(
        [*words, '--ros-args', '-r', f'__node:={name}'],
        env={**jazzy.environment, 'ROS_DOMAIN_ID': str(isolated_ros)},
        stdin=terminal,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    os.close(terminal)
    listener = spawn(Node('listener'))
    try:
        spin_until(spawn.pump, lambda: name in listener.get_node_names())
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
        os.close(master)
    assert process.returncode == 0, said
    assert 'Traceback' not in said
    # The documented line has compiled it.
    assert 'compiling' not in said


@pytest.mark.parametrize('robot', PLAYED)
def test_the_command_runs_from_the_workspace(robot, jazzy, workspace, tmp_path):
    script = workspace / 'install/wasd_bringup/lib/wasd_bringup/wasd'
    play(jazzy, SOURCED + f'exec {script} "$@"', robot, tmp_path)


def test_a_command_that_is_no_node_runs_from_the_workspace(jazzy, workspace):
    script = workspace / 'install/robot_description/lib/robot_description/describe'
    done = jazzy.run(SOURCED + f'{script} info go2')
    assert (done.returncode, done.stderr) == (0, '')


def test_colcon_test_runs_the_quick_tests(jazzy, workspace):
    # What the extra `test` brings is not there, but of Ubuntu's pytest.
    done = jazzy.run(SOURCED + 'cd ~/ros2_ws; colcon test --return-code-on-test-failure')
    assert done.returncode == 0, done.stdout + done.stderr
    for package in PACKAGES:
        (suite,) = ElementTree.parse(workspace / 'build' / package / 'pytest.xml').iter(
            'testsuite'
        )
        assert int(suite.get('tests', '0')) > 50
        assert (suite.get('failures'), suite.get('errors')) == ('0', '0')


@pytest.mark.parametrize('robot', PLAYED)
def test_the_script_installs_beside_jazzy_and_runs(robot, jazzy, tmp_path):
    play(jazzy, 'cd ~/ros2_ws/src/wasd; exec ./wasd "$@"', robot, tmp_path)
    python = jazzy.home / 'ros2_ws/src/wasd/.venv.jazzy/bin/python'
    done = jazzy.run(f'{python} -c "$1"', IMPORT)
    found = dict(line.split(' ') for line in done.stdout.splitlines())
    # The sourced ones, and no other numpy than theirs.
    assert all(Path(found[name]).is_relative_to(jazzy.prefix) for name in ('rclpy', 'pinocchio'))
    assert f'numpy=={found["version"]}' == FROM_APT['python3-numpy']
    assert not list(python.parents[1].glob('lib/*/site-packages/numpy*'))


def play(jazzy, command, robot, folder):
    """Run a robot by a script of keys at full speed; it has to move and to end well."""
    script = folder / 'keys'
    script.write_text(PLAYED[robot])
    words = (robot, '--play', str(script), '--duration', '5', '--speed', '0')
    done = jazzy.run(command, *words)
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'Traceback' not in done.stderr
    assert '5.0 s simulated' in done.stdout
    x = float(done.stdout.split(f'{robot} at ')[1].split()[0])
    assert x > 0.1
