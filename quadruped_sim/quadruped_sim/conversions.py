# SPDX-License-Identifier: Apache-2.0
"""The leg controller's states as messages, and readings from messages."""

from collections.abc import Iterable
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry as OdometryMessage

from quadruped_sim.records import Odometry


class Frames(NamedTuple):
    """Names of the frame in which odometry is given, and of the robot's that it follows."""

    odom: str
    base: str


def to_odometry(state: Odometry, stamp: Time, frames: Frames) -> OdometryMessage:
    """Return nav_msgs/Odometry: pose in the odom frame, twist in the base frame."""
    message = OdometryMessage()
    message.header.stamp = stamp
    message.header.frame_id = frames.odom
    message.child_frame_id = frames.base
    _set_xyz(message.pose.pose.position, state.position)
    _set_wxyz(message.pose.pose.orientation, state.orientation)
    _set_xyz(message.twist.twist.linear, state.linear_velocity)
    _set_xyz(message.twist.twist.angular, state.angular_velocity)
    message.pose.covariance[:] = state.pose_covariance.flatten()
    message.twist.covariance[:] = state.twist_covariance.flatten()
    return message


def to_transform(state: Odometry, stamp: Time, frames: Frames) -> TransformStamped:
    """Return the transform odom -> base of the same instant."""
    message = TransformStamped()
    message.header.stamp = stamp
    message.header.frame_id = frames.odom
    message.child_frame_id = frames.base
    _set_xyz(message.transform.translation, state.position)
    _set_wxyz(message.transform.rotation, state.orientation)
    return message


def _set_xyz(target: Any, values: Iterable[float]) -> None:
    target.x, target.y, target.z = map(float, values)


def _set_wxyz(target: Any, values: Iterable[float]) -> None:
    target.w, target.x, target.y, target.z = map(float, values)
