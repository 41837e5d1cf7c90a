# SPDX-License-Identifier: Apache-2.0
"""Poses and times, as messages have them."""

import math

from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
import numpy as np

from robot_description.pose import Pose


def to_seconds(stamp: Time) -> float:
    """Return the time of a stamp [s]."""
    return float(stamp.sec + 1e-9 * stamp.nanosec)


def to_transform(pose: Pose, parent: str, child: str, stamp: Time) -> TransformStamped:
    """Return the pose of the child frame in the parent frame as a transform."""
    message = TransformStamped()
    message.header.stamp = stamp
    message.header.frame_id = parent
    message.child_frame_id = child
    translation, rotation = message.transform.translation, message.transform.rotation
    translation.x, translation.y, translation.z = pose.position.tolist()
    rotation.w, rotation.x, rotation.y, rotation.z = to_quaternion(pose.rotation)
    return message


def to_quaternion(rotation: np.ndarray) -> tuple[float, float, float, float]:
    """Return the unit quaternion w, x, y, z, w >= 0, of a rotation matrix (Shepperd 1978)."""
    m = rotation.tolist()
    trace = m[0][0] + m[1][1] + m[2][2]
    candidates = [trace, m[0][0], m[1][1], m[2][2]]
    largest = candidates.index(max(candidates))
    if largest == 0:
        w = 0.5 * math.sqrt(1.0 + trace)
        s = 0.25 / w
        q = [w, s * (m[2][1] - m[1][2]), s * (m[0][2] - m[2][0]), s * (m[1][0] - m[0][1])]
    else:
        i = largest - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        value = 0.5 * math.sqrt(1.0 + m[i][i] - m[j][j] - m[k][k])
        s = 0.25 / value
        q = [s * (m[k][j] - m[j][k]), 0.0, 0.0, 0.0]
        q[1 + i] = value
        q[1 + j] = s * (m[j][i] + m[i][j])
        q[1 + k] = s * (m[k][i] + m[i][k])
    sign = 1.0 if q[0] >= 0.0 else -1.0
    return sign * q[0], sign * q[1], sign * q[2], sign * q[3]
