# SPDX-License-Identifier: Apache-2.0
"""Interfaces made from the wheels' generators: types are ROS' own, and an install is whole."""

from importlib.metadata import Distribution
import json
import os
from pathlib import Path
import shutil
import subprocess
import sys
import sysconfig

import pytest

from robot_description import build_interfaces

pytestmark = pytest.mark.slow

# What `ros2 topic info -v /tf` shows on any ROS 2: the name of the type's exact layout.
TYPE_HASH = 'RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087'
TF2_MSGS, NAV2_MSGS = build_interfaces.PACKAGES
# The fields of Nav2's actions for Jazzy (nav2_msgs 1.3); later ones have others.
FIELDS = """
from nav2_msgs.action import FollowWaypoints, NavigateToPose
from nav2_msgs.msg import MissedWaypoint
parts = [getattr(action, part) for action in (NavigateToPose, FollowWaypoints)
         for part in ('Goal', 'Result', 'Feedback')]
for part in (*parts, MissedWaypoint):
    print(*(f'{name}:{kind}' for name, kind in part.get_fields_and_field_types().items()))
print(NavigateToPose.Result.NONE)
result = FollowWaypoints.Result
print(result.NONE, result.UNKNOWN, result.TASK_EXECUTOR_FAILED)
"""
ACTIONS = [
    'pose:geometry_msgs/PoseStamped behavior_tree:string',
    'error_code:uint16 error_msg:string',
    'current_pose:geometry_msgs/PoseStamped navigation_time:builtin_interfaces/Duration '
    'estimated_time_remaining:builtin_interfaces/Duration number_of_recoveries:int16 '
    'distance_remaining:float',
    'number_of_loops:uint32 goal_index:uint32 poses:sequence<geometry_msgs/PoseStamped>',
    'missed_waypoints:sequence<nav2_msgs/MissedWaypoint> error_code:uint16 error_msg:string',
    'current_waypoint:uint32',
    'index:uint32 goal:geometry_msgs/PoseStamped error_code:uint16',
    '0',
    '0 600 601',
]
RESOURCES = Path(sys.prefix) / 'share/rosidl_generator_py/resource'
COMPILERS = [name for name in ('g++', 'c++', 'clang++') if shutil.which(name)]
HEADER = Path(sysconfig.get_path('include')) / 'Python.h'

wheels = pytest.mark.skipif(not RESOURCES.is_dir(), reason='ROS does not come as wheels here')
can_build = pytest.mark.skipif(
    not (RESOURCES.is_dir() and COMPILERS and HEADER.is_file()),
    reason='no wheels of ROS, no C++ compiler or no Python.h',
)


class Prefix:
    """An empty environment that tf2_msgs is installed into; the wheels stay where they are."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder = folder
        self.site = folder / 'site-packages'
        for made in (self.site, folder / 'lib'):
            made.mkdir()
        self.place = build_interfaces.Place(folder, self.site)
        monkeypatch.setattr(build_interfaces, 'HERE', self.place)
        # What this Python has is not what the new environment has.
        monkeypatch.setattr(build_interfaces, 'is_importable', lambda name: False)

    def run(self, code: str) -> 'subprocess.CompletedProcess[str]':
        """Run code in a Python that finds what was installed here."""
        libraries = [str(self.folder / 'lib'), os.environ.get('LD_LIBRARY_PATH', '')]
        environment = {
            **os.environ,
            'PYTHONPATH': str(self.site),
            'LD_LIBRARY_PATH': os.pathsep.join(libraries),
        }
        command = [sys.executable, '-c', code]
        return subprocess.run(command, env=environment, capture_output=True, text=True)

    def files(self) -> list[str]:
        """Return what is installed."""
        return sorted(
            path.relative_to(self.folder).as_posix()
            for path in self.folder.rglob('*')
            if path.is_file()
        )


@pytest.fixture
def prefix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Prefix:
    return Prefix(tmp_path, monkeypatch)


@can_build
def test_what_is_built_is_ros_own_message_and_is_built_once(prefix, capfd, monkeypatch):
    # Less of Nav2's, for generators take seconds: an action, and a message that it is made of.
    instead = ('NavigateToPose', 'FollowWaypoints')
    check = NAV2_MSGS.check.replace(*instead)
    less = NAV2_MSGS._replace(interfaces=NAV2_MSGS.interfaces[:2], check=check)
    monkeypatch.setattr(build_interfaces, 'PACKAGES', (TF2_MSGS, less))
    assert build_interfaces.main() == 0
    said = capfd.readouterr().out
    assert 'tf2_msgs built in' in said
    assert 'nav2_msgs built in' in said
    described = json.loads((prefix.folder / 'share/tf2_msgs/msg/TFMessage.json').read_text())
    hashes = {item['type_name']: item['hash_string'] for item in described['type_hashes']}
    assert hashes['tf2_msgs/msg/TFMessage'] == TYPE_HASH
    used = prefix.run(
        'from tf2_msgs.msg import TFMessage; import tf2_msgs\n'
        'from rclpy.serialization import serialize_message\n'
        'print(tf2_msgs.__path__[0], len(serialize_message(TFMessage())))'
    )
    # Four bytes of CDR header and an empty sequence's length.
    assert used.stdout.split() == [f'{prefix.site}/tf2_msgs', '8'], used.stderr
    before = prefix.files()
    assert build_interfaces.main() == 0
    assert 'tf2_msgs is there\nnav2_msgs is there\n' in capfd.readouterr().out
    assert prefix.files() == before
    assert not [name for name in before if name.endswith(('.c', '.cpp', '.h', '.new'))]
    for name in ('tf2_msgs', 'nav2_msgs'):
        assert f'share/ament_index/resource_index/packages/{name}' in before
    for name in ('action/FollowWaypoints', 'msg/MissedWaypoint'):
        assert f'share/nav2_msgs/{name}.json' in before
    used = prefix.run(FIELDS.replace(*instead))
    assert used.stdout.splitlines() == ACTIONS[3:6] + ACTIONS[3:], used.stderr
    # pip knows of it, as if it had come as a wheel, and could remove all of it.
    known = Distribution.at(next(prefix.site.glob('*.dist-info')))
    assert known.name == 'wasd-interfaces'
    listed = {Path(file.locate()).resolve() for file in known.files or ()}
    assert listed == {(prefix.folder / name).resolve() for name in before if '.pyc' not in name}


@can_build
@pytest.mark.skipif('WASD_TEST_WHEELS' not in os.environ, reason='WASD_TEST_WHEELS=1 asks')
def test_the_wheel_brings_all_that_a_build_installs(prefix, tmp_path_factory, capfd):
    folder = tmp_path_factory.mktemp('wheel')
    assert build_interfaces.main(['--wheel', str(folder)]) == 0
    (path,) = folder.glob('*.whl')
    assert capfd.readouterr().out == f'{path}\n'
    assert path.name.endswith('-manylinux_2_28_x86_64.whl')  # as ROS' own
    words = ('install', '--quiet', '--no-deps', '--ignore-installed', '--prefix')
    subprocess.run(
        [sys.executable, '-m', 'pip', *words, str(prefix.folder), str(path)], check=True
    )
    (site,) = prefix.folder.glob('lib/python*/site-packages')
    by_pip = {p.relative_to(site) for p in site.rglob('*') if p.is_file()}
    assert build_interfaces.main() == 0
    built = {p.relative_to(prefix.site) for p in prefix.site.rglob('*') if p.is_file()}
    assert built <= by_pip
    prefix.site = site
    used = prefix.run(FIELDS)
    assert used.stdout.splitlines() == ACTIONS, used.stderr


@pytest.mark.skipif(
    build_interfaces.state(NAV2_MSGS) in ('missing', 'stale'), reason='no actions of Nav2 here'
)
def test_the_actions_that_are_here_have_the_fields_and_numbers_of_jazzy(capsys):
    exec(FIELDS, {})
    assert capsys.readouterr().out.splitlines() == ACTIONS


@can_build
def test_an_interrupted_install_leaves_nothing_that_can_be_imported(
    prefix, monkeypatch, tmp_path_factory
):
    made = tmp_path_factory.mktemp('made')
    code = made / build_interfaces.PYTHON / 'tf2_msgs'
    for folder in (made / 'lib', code):
        folder.mkdir(parents=True)
    (code / '__init__.py').touch()

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(shutil, 'copytree', interrupted)
        build_interfaces.install(TF2_MSGS, made, prefix.place)
    assert list(prefix.site.iterdir()) == []
    assert build_interfaces.state(TF2_MSGS) == 'missing'
    build_interfaces.install(TF2_MSGS, made, prefix.place)
    assert build_interfaces.state(TF2_MSGS) == 'current'


def test_a_build_by_another_recipe_is_stale(prefix):
    (prefix.site / 'tf2_msgs').mkdir()
    stamp = prefix.site / 'tf2_msgs' / build_interfaces.STAMP
    stamp.write_text('an older recipe\n')
    assert build_interfaces.state(TF2_MSGS) == 'stale'
    stamp.write_text(build_interfaces.fingerprint(TF2_MSGS))
    assert build_interfaces.state(TF2_MSGS) == 'current'


def test_an_interface_of_somebody_else_is_left_alone(prefix, monkeypatch, capfd):
    monkeypatch.setattr(build_interfaces, 'is_importable', lambda name: True)
    assert build_interfaces.main() == 0
    assert capfd.readouterr().out == 'tf2_msgs is there\nnav2_msgs is there\n'
    assert prefix.files() == []


@wheels
@pytest.mark.parametrize('header', [HEADER, Path('/no such/Python.h')])
def test_without_a_compiler_one_line_says_what_to_install(prefix, monkeypatch, capfd, header):
    monkeypatch.setenv('PATH', '')
    monkeypatch.setattr(build_interfaces, 'HEADER', header)
    assert build_interfaces.main() == 2
    said = capfd.readouterr().err
    missing = 'no tf2_msgs, so no /tf; no nav2_msgs, so no navigate_to_pose and follow_waypoints'
    assert said.startswith(f'error: {missing}: no C++ compiler')
    assert 'sudo apt install g++ python3-dev; then: ' in said
    assert said.endswith('python -m robot_description.build_interfaces\n')
    assert (said.count('\n'), f'no {header}' in said) == (1, not header.is_file())
    assert prefix.files() == []


@can_build
def test_a_compiler_that_fails_is_quoted(prefix, monkeypatch, capfd, tmp_path):
    compiler = tmp_path / 'bad++'
    compiler.write_text('#!/bin/sh\necho "x.c:1: error: out of luck" >&2; exit 1\n')
    compiler.chmod(0o755)
    monkeypatch.setenv('CXX', str(compiler))

    def generate(_: object, made: Path) -> None:
        source = made / 'rosidl_generator_c/tf2_msgs/msg/detail/x.c'
        source.parent.mkdir(parents=True)
        source.touch()

    monkeypatch.setattr(build_interfaces, 'generate', generate)
    assert build_interfaces.main() == 2
    said = capfd.readouterr().err
    assert (said.count('\n'), 'error: out of luck' in said) == (1, True)
    assert prefix.site not in [path.parent for path in prefix.folder.rglob('tf2_msgs')]
