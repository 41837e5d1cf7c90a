# SPDX-License-Identifier: Apache-2.0
"""A controller of another kind is its own package and a row of ROBOTS; the wheel has one list."""

import json
from pathlib import Path

import pytest
from wasd_bringup.cli import main
from wasd_bringup.robots import Kind, RobotRow, ROBOTS

pytestmark = pytest.mark.slow

# It turns on the spot by torque alone, as fast as it is told, and knows no odometry.
PACKAGE = """
import numpy as np
from mujoco_sim.viewer.page import CameraView
from rclpy.node import Node
from std_msgs.msg import String
from teleop_keyboard.dashboard import Status
from wasd_bringup.report import Sample
from wasd_bringup.stack import ControlStack
from wasd_core.robot_io import JointCommand
from wasd_core.timing import Notice

class SpinNode(Node):
    state = 'spinning'
    turn = 0.0

    def __init__(self, options):
        super().__init__('spin', namespace=options.namespace)
        self.controller = self.cmd_vel = self

    def put(self, twist):
        self.turn = twist.angular.z

    def odometry(self):
        return None

    def close(self):
        self.turn = 0.0

class SpinStack(ControlStack):
    camera = CameraView(1.0, 0.0, 0.0)
    period = 0.01
    help_lines = ('j l turn',)
    first_keys = 'j'
    drive_limits = {}
    base_odometry = None

    def __init__(self, loaded, world, options):
        super().__init__(world, options, SpinNode(options))
        self.notice = Notice()

    def press(self, key):
        self._teleop.keys.put(String(data=key))

    def sample(self):
        return Sample('spinning', (0.0, 0.0, self._controller.turn), (0.0, 0.0, 0.0), [])

    def status(self):
        return Status('spinning')

    def _schedule_publishing(self, schedule):
        pass

    def _control(self):
        names = self._world.motor_names
        parts = np.zeros((len(JointCommand._fields), len(names)))
        sides = [-1.0 if 'left' in name else 1.0 for name in names]
        parts[2] = 0.02 * self._controller.turn * np.array(sides)
        self._world.apply(JointCommand(*parts))
"""


@pytest.fixture
def spin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have a package `spin_sim`, and a row that names what drives in it."""
    (tmp_path / 'spin_sim').mkdir()
    (tmp_path / 'spin_sim/__init__.py').write_text('')
    (tmp_path / 'spin_sim/stack.py').write_text(PACKAGE)
    monkeypatch.syspath_prepend(tmp_path)
    kind = Kind('spin_sim.stack:SpinStack', 'spin_sim.page:Spin', 'mbot', lambda parser: None)
    row = RobotRow(name='spin', kind=kind, summary='turn', description='mbot', preset='mbot')
    monkeypatch.setitem(ROBOTS, 'spin', row)


def test_a_controller_of_another_kind_is_its_package_and_a_row(
    spin: None, tmp_path: Path, isolated_ros: None
) -> None:
    (tmp_path / 'script').write_text('0.2 0 0 1\n')
    report = tmp_path / 'report.json'
    words = f'spin --twist {tmp_path}/script --speed 0 --viewer none --duration 2'
    assert main([*words.split(), '--report', str(report)]) == 0
    samples = json.loads(report.read_text())['samples']
    assert set(samples['state']) == {'spinning'}
    assert samples['command'][-1] == [0.0, 0.0, 1.0]
    assert max(yaw for _, _, yaw in samples['rpy']) > 0.5
