# SPDX-License-Identifier: Apache-2.0
"""The controller's states as messages."""

import math

from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry

from diff_drive_sim.odometry import OdometryState
from diff_drive_sim.parameters import DiffDriveParameters

# A planar robot knows nothing of these: 1e6 tells a filter to look elsewhere.
UNKNOWN_VARIANCE = 1e6
KNOWN_VARIANCE = 1e-3
# x, y, z, roll, pitch, yaw on the diagonal of a 6 x 6 covariance, row-major.
_DIAGONAL = slice(0, 36, 7)
_VARIANCES = [KNOWN_VARIANCE] * 2 + [UNKNOWN_VARIANCE] * 3 + [KNOWN_VARIANCE]


def to_odometry(state: OdometryState, stamp: Time, parameters: DiffDriveParameters) -> Odometry:
    """Return nav_msgs/Odometry: pose in the odom frame, twist in the base frame."""
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id = parameters.odom_frame
    message.child_frame_id = parameters.base_frame
    message.pose.pose.position.x = state.x
    message.pose.pose.position.y = state.y
    message.pose.pose.orientation.z = math.sin(0.5 * state.yaw)
    message.pose.pose.orientation.w = math.cos(0.5 * state.yaw)
    message.twist.twist.linear.x = state.linear
    message.twist.twist.linear.y = state.lateral
    message.twist.twist.angular.z = state.angular
    message.pose.covariance[_DIAGONAL] = _VARIANCES
    message.twist.covariance[_DIAGONAL] = _VARIANCES
    return message


def to_transform(
    state: OdometryState, stamp: Time, parameters: DiffDriveParameters
) -> TransformStamped:
    """Return the transform odom -> base of the same instant."""
    message = TransformStamped()
    message.header.stamp = stamp
    message.header.frame_id = parameters.odom_frame
    message.child_frame_id = parameters.base_frame
    message.transform.translation.x = state.x
    message.transform.translation.y = state.y
    message.transform.rotation.z = math.sin(0.5 * state.yaw)
    message.transform.rotation.w = math.cos(0.5 * state.yaw)
    return message
