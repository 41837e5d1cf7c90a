# SPDX-License-Identifier: Apache-2.0
"""Velocities as messages, and a pose from one."""

import math

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistStamped

from diff_drive_sim.limits import Velocity
from diff_drive_sim.odometry import DiffDriveError, PlanarCovariance


def from_pose(
    message: PoseWithCovarianceStamped, frame: str
) -> tuple[float, float, float, PlanarCovariance]:
    """
    Return x, y [m], yaw [rad] and their covariance.

    Raises:
        DiffDriveError: the pose is in another frame than `frame`, or is no pose.
    """
    if message.header.frame_id not in ('', frame):
        raise DiffDriveError(
            f'wanted a pose in frame {frame!r}, got one in {message.header.frame_id!r}'
        )
    position, q = message.pose.pose.position, message.pose.pose.orientation
    c = message.pose.covariance
    numbers = (position.x, position.y, q.x, q.y, q.z, q.w, *c)
    if not all(map(math.isfinite, numbers)) or q.x == q.y == q.z == q.w == 0.0:
        raise DiffDriveError('wanted a pose of finite numbers and an orientation that is not 0')
    yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), q.w**2 + q.x**2 - q.y**2 - q.z**2)
    return position.x, position.y, yaw, PlanarCovariance(c[0], c[1], c[7], c[5], c[11], c[35])


def to_twist_stamped(velocity: Velocity, stamp: Time, frame: str) -> TwistStamped:
    """Return a velocity of the base frame."""
    message = TwistStamped()
    message.header.stamp = stamp
    message.header.frame_id = frame
    message.twist.linear.x, message.twist.angular.z = velocity
    return message
