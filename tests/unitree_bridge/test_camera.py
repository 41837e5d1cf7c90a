# SPDX-License-Identifier: Apache-2.0
"""The picture that SDK programs get is that of the camera which the description can carry."""

from mujoco_sim.sensors.table import read_sensor_tags
import numpy as np
from robot_description.description import load_robot
from unitree_bridge.legs_robot import _EYE, _HEIGHT, _VIEW, _WIDTH


def test_both_look_from_one_place_by_one_lens():
    robot = load_robot('go2', arguments={'camera': 'true'}).robot
    _, (camera,), _ = read_sensor_tags(robot).kinds
    np.testing.assert_allclose(robot.joints['front_camera_joint'].pose.position, _EYE)
    assert (camera.width, camera.height) == (_WIDTH, _HEIGHT)
    np.testing.assert_allclose(_VIEW.half_width, np.tan(0.5 * camera.field_of_view))
