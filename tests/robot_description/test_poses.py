# SPDX-License-Identifier: Apache-2.0
import math

from builtin_interfaces.msg import Time
from cases import for_all
import numpy as np
import pytest
from wasd_core.messages import to_transform
from wasd_core.rotations import axis_angle, Pose, rpy_matrix, to_quaternion

RNG = np.random.default_rng(2)
AXES = RNG.normal(size=(6, 3)).tolist() + np.eye(3).tolist()


def to_matrix(w, x, y, z):
    """Return the rotation matrix of a unit quaternion."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@for_all('axis', AXES)
@for_all('angle', [0.0, 1e-9, 0.1, 2.0, math.pi - 1e-9, math.pi, -3.0])
def test_a_quaternion_is_the_rotation_it_came_from(axis, angle):
    rotation = axis_angle(np.array(axis) / np.linalg.norm(axis), angle)
    quaternion = to_quaternion(rotation)
    assert math.hypot(*quaternion) == pytest.approx(1.0, abs=1e-14)
    assert quaternion[0] >= 0.0
    np.testing.assert_allclose(to_matrix(*quaternion), rotation, atol=1e-14)


def test_a_transform_carries_pose_frames_and_stamp():
    stamp = Time(sec=3, nanosec=5)
    pose = Pose(np.array([1.0, 2.0, 3.0]), rpy_matrix(0.0, 0.0, math.pi / 2))
    message = to_transform(pose, 'base_link', 'wheel', stamp)
    assert message.header.stamp == stamp
    assert (message.header.frame_id, message.child_frame_id) == ('base_link', 'wheel')
    translation, rotation = message.transform.translation, message.transform.rotation
    assert (translation.x, translation.y, translation.z) == (1.0, 2.0, 3.0)
    assert rotation.z == pytest.approx(math.sqrt(0.5))
    assert rotation.w == pytest.approx(math.sqrt(0.5))
