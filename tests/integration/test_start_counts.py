# SPDX-License-Identifier: Apache-2.0
"""
At a start a description is parsed once, its legs are found once, Pinocchio builds one model.

No second Python is started for it.
"""

import json
import subprocess
import sys

import pytest
from quadruped_sim.compilation import warm_up
from quadruped_sim.robot_model import RobotModel
from robot_description.description import load_robot
from terminals import PATIENCE

pytestmark = pytest.mark.slow

# Before anything else takes these functions by their names.
COUNT = """
import collections, json, sys

counts = collections.Counter()

def count_pythons(event, arguments):
    if event == 'subprocess.Popen' and sys.executable in (arguments[0], *arguments[1]):
        counts['started'] += 1

sys.addaudithook(count_pythons)
import pinocchio
from robot_description import urdf
from robot_description.morphology import quadruped
from robot_description.xacro import session

def count(module, name, what):
    real = getattr(module, name)
    def counted(*arguments, **options):
        counts[what] += 1
        return real(*arguments, **options)
    setattr(module, name, counted)

count(session, 'expand_document', 'read')
count(urdf, 'parse_urdf', 'parsed')
count(quadruped, 'find_quadruped', 'recognised')
for name in dir(pinocchio):
    if name.startswith('buildModel'):
        count(pinocchio, name, 'modelled')

from wasd_core.node import init_ros
init_ros([])
"""
SESSION = """
from wasd_bringup.run.options import RunOptions
from wasd_bringup.ros.face import make_ros_run
built = make_ros_run(RunOptions(robot='go2', description='go2', preset='unitree', speed=0.0))
built.close()
"""
NODE = """
from quadruped_sim.leg_controller_node import LegControllerNode
LegControllerNode().close()
"""
SCRIPT = """
import wasd
wasd.Go2()
"""


@pytest.fixture(scope='module')
def compiled() -> None:
    """Have the leg controller in numba's cache: who compiles it models the robot once more."""
    warm_up(RobotModel(load_robot('go2')))


@pytest.mark.usefixtures('compiled')
def test_a_go2_is_read_parsed_recognised_and_modelled_once(isolated_ros):
    builds = (SESSION, NODE, SCRIPT)
    code = COUNT + ''.join(f'{each}print(json.dumps(counts))\ncounts.clear()' for each in builds)
    done = subprocess.run(
        [sys.executable, '-c', code], check=False, capture_output=True, text=True, timeout=PATIENCE
    )
    assert done.returncode == 0, done.stderr
    found = [json.loads(line) for line in done.stdout.splitlines()[-len(builds) :]]
    assert found == len(builds) * [{'read': 1, 'parsed': 1, 'recognised': 1, 'modelled': 1}]
