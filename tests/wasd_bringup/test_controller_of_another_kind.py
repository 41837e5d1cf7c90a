# SPDX-License-Identifier: Apache-2.0
"""A controller of another kind is its own package and a row of ROBOTS, as CONTRIBUTING says."""

import json
from pathlib import Path

import pytest
from wasd_bringup.cli import main
from wasd_bringup.robots import Kind, RobotRow, ROBOTS

pytestmark = pytest.mark.slow

WHEEL = """
<link name="{name}"><inertial><mass value="0.3"/><inertia ixx="4e-4" iyy="6e-4" izz="4e-4"
  ixy="0" ixz="0" iyz="0"/></inertial><collision><origin rpy="1.5708 0 0"/><geometry>
  <cylinder radius="0.06" length="0.03"/></geometry></collision></link>
<joint name="{name}_axle" type="continuous"><parent link="base"/><child link="{name}"/>
  <origin xyz="{x} {y} -0.04"/><axis xyz="0 1 0"/>{limit}</joint>
<gazebo reference="{name}"><mu1>1.0</mu1></gazebo>
"""
CART = """
<robot name="cart"><link name="base"><inertial><mass value="3"/><inertia ixx="0.02" iyy="0.04"
  izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><box size="0.4 0.2 0.05"/>
  </geometry></collision></link>{wheels}</robot>
"""
PACKAGE = """
import numpy as np
from mujoco_sim.viewer.camera import CameraView
from teleop_keyboard.dashboard import Status
from wasd_bringup.run.report import Sample
from wasd_bringup.run.robot import Robot
from wasd_core.robot_io import JointCommand
from wasd_core.timing import Notice


class Cart(Robot):
    '''A cart whose one driven wheel has the speed that it is told, for half a second.'''

    camera = CameraView(1.0, 0.0, 0.0)
    period = 0.01
    help_lines = ('i , drive',)
    first_keys = 'i'
    ahead, silent = 0.0, 0.0

    def __init__(self, *parts):
        super().__init__(*parts)
        self.notice = Notice()

    @property
    def state(self):
        return 'rolling' if self.ahead else 'standing'

    def command(self, velocity):
        self.ahead, self.silent = velocity[0], 0.0

    def control(self):
        self.silent += self.period
        if self.silent > 0.5:
            self.ahead = 0.0
        names = self.world.motor_names
        rows = np.zeros((len(JointCommand._fields), len(names)))
        wheel = names.index('drive_axle')
        rows[1, wheel], rows[4, wheel] = self.ahead / 0.06, 0.2  # dq [rad/s], kd [N m s/rad]
        self.world.apply(JointCommand(*rows))

    def sample(self):
        return Sample(self.state, (self.ahead, 0.0, 0.0), (0.0, 0.0, 0.0), [])

    def _status(self):
        return Status(self.state)
"""


@pytest.fixture
def cart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a package `cart_sim`, and a row that names what drives in it."""
    limit = '<limit effort="5" velocity="30"/>'
    wheels = [('drive', -0.15, 0.0, limit), ('left', 0.15, 0.1, ''), ('right', 0.15, -0.1, '')]
    parts = [WHEEL.format(name=n, x=x, y=y, limit=most) for n, x, y, most in wheels]
    description = tmp_path / 'cart.urdf'
    description.write_text(CART.format(wheels=''.join(parts)))
    (tmp_path / 'cart_sim').mkdir()
    (tmp_path / 'cart_sim/__init__.py').write_text(PACKAGE)
    monkeypatch.syspath_prepend(tmp_path)
    row = RobotRow(
        name='cart',
        kind=Kind(robot='cart_sim:Cart'),
        summary='roll',
        description=str(description),
        preset='mbot',
    )
    monkeypatch.setitem(ROBOTS, 'cart', row)


@pytest.mark.parametrize('words', ['', '--no-ros'])
def test_a_controller_of_another_kind_is_its_package_and_a_row(
    cart: None, tmp_path: Path, isolated_ros: None, words: str
) -> None:
    assert len(PACKAGE.splitlines()) < 120
    (tmp_path / 'script').write_text('0.2 0.3 0 0\n2 stop\n')
    report = tmp_path / 'report.json'
    command = f'cart {words} --twist {tmp_path}/script --speed 0 --viewer none --duration 4'
    assert main([*command.split(), '--report', str(report)]) == 0
    samples = json.loads(report.read_text())['samples']
    assert samples['state'][50] == 'rolling'
    assert samples['state'][-1] == 'standing'  # half a second after the last velocity
    assert 0.4 < samples['position'][-1][0] < 0.8
    assert abs(samples['velocity'][-1][0]) < 0.01
