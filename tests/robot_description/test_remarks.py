# SPDX-License-Identifier: Apache-2.0
"""Comments and processing instructions may stand anywhere in a description, and mean nothing."""

from cases import for_all
import pytest
from robot_description.description import read_description
from robot_description.lint.session import lint
from robot_description.xacro.session import XacroSession

pytestmark = pytest.mark.slow

REMARKS = ('<!-- 1 --><?made by hand?>', '<?made?><!-- <link name="x"/> -->', '')
ROBOT = """<?xml version="1.0"?>{r}
<robot name="box"{more}>{r}
  <link name="box">{r}<inertial>{r}<mass value="2">{r}</mass>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>{r}</inertial>
    <collision>{r}<geometry>{r}<box size="1 1 1"/>{r}</geometry></collision>{r}</link>
  <link name="lid"/>
  <joint name="hinge" type="fixed">{r}<parent link="box"/>{r}<child link="lid"/>{r}</joint>
  <gazebo reference="box">{r}<mu1>0.{r}5{r}</mu1>{r}<self_collide>{r}true</self_collide>
  </gazebo>{r}
</robot>{r}
"""


@for_all('remark', REMARKS)
@for_all('more', ['', ' xmlns:xacro="http://www.ros.org/wiki/xacro"'])
def test_a_robot_is_the_same_with_remarks_anywhere(remark, more, tmp_path):
    path = tmp_path / 'box.urdf'
    path.write_text(ROBOT.format(r=remark, more=more))
    robot = read_description(path).robot
    assert (robot.mass, list(robot.joints), robot.friction) == (2.0, ['hinge'], {'box': 0.5})
    assert robot.self_collide == {'box': True}
    assert lint(XacroSession(path)) == []
