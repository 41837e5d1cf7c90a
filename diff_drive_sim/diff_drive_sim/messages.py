# SPDX-License-Identifier: Apache-2.0
"""A pose from a message."""

import math

from geometry_msgs.msg import PoseWithCovarianceStamped

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
