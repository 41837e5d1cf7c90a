# SPDX-License-Identifier: Apache-2.0
"""`colcon build`, sourced: every executable is there, and some of them run."""

from importlib import import_module
import json
import os
from pathlib import Path
import sys
import time
import uuid

from executables import SCRIPTS
import pytest
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.node import Node

ROOT = Path(__file__).resolve().parents[2]
EXECUTABLES = {name: target.partition('.')[0] for name, target in SCRIPTS.items()}
PACKAGES = sorted(set(EXECUTABLES.values()))
# What runs each program.
PROGRAMS = sorted(
    getattr(import_module(module), name).module
    for module, _, name in (target.partition(':') for target in SCRIPTS.values())
    if module.endswith('.parameters')
)
# The nodes that are started, and with what words.
NODES = {'simulator': (), 'leg_controller': (), 'wasd': ('mbot', '--viewer', 'none')}
# Where the checkout has not compiled it, the leg controller takes a minute of a core.
PATIENCE = 180.0

pytestmark = [pytest.mark.long, pytest.mark.slow, pytest.mark.takes_up_to(4.0 * PATIENCE)]

WHERE = """
import importlib, json, sys
from robot_description.packages import share_directory
names = sys.argv[1:]
print(json.dumps({name: importlib.import_module(name).__file__ for name in names}))
"""


def test_each_package_and_program_is_imported_from_the_workspace(workspace):
    done = workspace.run(sys.executable, '-c', WHERE, *PACKAGES, *PROGRAMS)
    assert done.returncode == 0, done.stderr
    for name, package in EXECUTABLES.items():
        assert os.access(workspace.install / package / 'lib' / package / name, os.X_OK)
    for name, path in json.loads(done.stdout).items():
        build = workspace.install.parent
        assert Path(path).is_relative_to(build), f'{name} is imported from {path}'


@pytest.mark.parametrize('package', PACKAGES)
def test_share_has_what_ros_tools_look_for(package, workspace):
    share = workspace.install / package / 'share' / package
    index = workspace.install / package / 'share/ament_index/resource_index/packages' / package
    assert (share / 'package.xml').is_file()
    assert index.is_file()
    for folder in ('config', 'foxglove', 'launch', 'rviz'):
        names = {path.name for path in (ROOT / package).glob(f'{folder}/*.*')}
        assert {path.name for path in (share / folder).glob('*.*')} == names


def test_the_descriptions_are_where_rviz_looks_for_them(workspace):
    share = workspace.install / 'robot_description/share/robot_description'
    made = {path.relative_to(share).as_posix() for path in share.rglob('*.xacro')}
    source = ROOT / 'robot_description/robot_description'
    assert made == {path.relative_to(source).as_posix() for path in source.rglob('*.xacro')}


def test_a_command_works_from_the_workspace(workspace):
    path = workspace.install / 'robot_description/lib/robot_description/describe'
    done = workspace.run(str(path), 'info', 'mbot')
    assert (done.returncode, done.stderr) == (0, '')
    assert done.stdout


@pytest.mark.parametrize(
    ('workspace', 'executable'),
    [(('--symlink-install',), name) for name in NODES],
    indirect=['workspace'],
)
def test_an_executable_answers_its_parameters_and_stops_cleanly(
    executable, start, spawn, spin_until
):
    # A name that no other simulator on this machine has, whatever its ROS domain.
    namespace = f'/colcon_{uuid.uuid4().hex}'
    words = (*NODES[executable], '--ros-args', '-r', f'__ns:={namespace}')
    program = start(EXECUTABLES[executable], executable, *words)
    node = f'{namespace}/{executable.replace("wasd", "simulator")}'
    asker = spawn(Node('asker'))
    lister = asker.create_client(ListParameters, f'{node}/list_parameters')
    getter = asker.create_client(GetParameters, f'{node}/get_parameters')

    def answer(client, request):
        asked = []

        def is_answered():
            # Parameters are there before the node is, whose compilation comes in between; an
            # answer is lost where the node has not yet found who asks.
            if time.monotonic() > 10.0 * len(asked) + begin:
                asked.append(client.call_async(request))
            return any(future.done() for future in asked)

        begin = time.monotonic()
        spin_until(spawn.pump, is_answered)
        return next(future.result() for future in asked if future.done())

    def is_there():
        assert program.process.poll() is None, program.said
        return lister.service_is_ready() and getter.service_is_ready()

    spin_until(spawn.pump, is_there)
    names = answer(lister, ListParameters.Request()).result.names
    values = answer(getter, GetParameters.Request(names=names)).values
    assert 'use_sim_time' in names
    assert len(values) == len(names)
    assert ParameterType.PARAMETER_NOT_SET not in {value.type for value in values}
    assert program.interrupt() == 0, program.said
    assert 'Traceback' not in program.said
