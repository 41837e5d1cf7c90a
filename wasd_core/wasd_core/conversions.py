# SPDX-License-Identifier: Apache-2.0
"""Poses and times, as messages have them."""

from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped

from wasd_core.rotations import Pose
from wasd_core.rotations import to_quaternion


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


def to_stamp(simulated: float) -> Time:
    """Return simulated time [s] as a stamp."""
    nanoseconds = round(simulated * 1e9)
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
