# SPDX-License-Identifier: Apache-2.0
"""Scans, odometry and goals out of messages; maps, paths, poses and transforms into them."""

import array
import math
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from geometry_msgs.msg import PoseWithCovarianceStamped
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import MapMetaData
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Odometry as OdometryMessage
from nav_msgs.msg import Path
import numpy as np
from sensor_msgs.msg import LaserScan
from wasd_core.errors import InvalidMessage
from wasd_core.rotations import matrix_from_quaternion
from wasd_core.rotations import Pose
from wasd_core.rotations import rpy_from_matrix
from wasd_core.rotations import yaw_matrix

from wasd_navigation.grid import Grid
from wasd_navigation.odometry_memory import Odometry
from wasd_navigation.scan import read_tilted_scan
from wasd_navigation.scan import Scan

# x, y and yaw in a covariance of x, y, z, roll, pitch, yaw, shape (6, 6).
_PLANAR = np.ix_((0, 1, 5), (0, 1, 5))


def from_pose(pose: Any) -> Pose:
    """
    Return a geometry_msgs/Pose, or a Transform.

    Raises:
        InvalidMessage: a number is not finite, or the orientation is 0.
    """
    p = getattr(pose, 'position', None) or pose.translation
    q = getattr(pose, 'orientation', None) or pose.rotation
    numbers = (p.x, p.y, p.z, q.w, q.x, q.y, q.z)
    if not all(map(math.isfinite, numbers)) or not any(numbers[3:]):
        raise InvalidMessage('wanted a pose of finite numbers and an orientation that is not 0')
    return Pose(np.array(numbers[:3]), matrix_from_quaternion(np.array(numbers[3:])))


def to_planar(pose: Pose) -> np.ndarray:
    """Return x, y [m] and yaw [rad] of a pose, shape (3,)."""
    return np.array([*pose.position[:2], rpy_from_matrix(pose.rotation)[2]])


def from_odometry(message: OdometryMessage) -> Odometry:
    """
    Return odometry as seen from above.

    Raises:
        InvalidMessage: its pose is not finite.
    """
    pose = from_pose(message.pose.pose)
    planar = to_planar(pose)
    level = Pose(
        np.array([0.0, 0.0, pose.position[2]]), yaw_matrix(-float(planar[2])) @ pose.rotation
    )
    twist = message.twist.twist
    velocity = np.array([twist.linear.x, twist.linear.y, twist.angular.z])
    covariance = np.array(message.pose.covariance).reshape(6, 6)[_PLANAR]
    return Odometry(planar, velocity, covariance, level)


def from_scan(message: LaserScan, mount: Pose) -> Scan:
    """Return the rays of a scan; `mount` is the lidar's pose in the level frame below the base."""
    ranges = np.array(message.ranges, dtype=float)
    angles = message.angle_min + message.angle_increment * np.arange(len(ranges))
    return read_tilted_scan(ranges, angles, (message.range_min, message.range_max), mount)


def to_pose(planar: np.ndarray, message: Any) -> Any:
    """Write x, y [m] and yaw [rad] into a geometry_msgs/Pose; return it."""
    x, y, yaw = map(float, planar)
    message.position.x, message.position.y = x, y
    message.orientation.z, message.orientation.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    return message


def to_pose_stamped(planar: np.ndarray, stamp: Time, frame: str) -> PoseStamped:
    """Return a pose of the plane."""
    message = PoseStamped()
    message.header.stamp, message.header.frame_id = stamp, frame
    to_pose(planar, message.pose)
    return message


def to_located(
    planar: np.ndarray, covariance: np.ndarray, stamp: Time, frame: str
) -> PoseWithCovarianceStamped:
    """Return a pose of the plane with its covariance, shape (3, 3)."""
    message = PoseWithCovarianceStamped()
    message.header.stamp, message.header.frame_id = stamp, frame
    to_pose(planar, message.pose.pose)
    whole = np.zeros((6, 6))
    whole[_PLANAR] = covariance
    message.pose.covariance = whole.flatten()
    return message


def to_transform(planar: np.ndarray, stamp: Time, parent: str, child: str) -> TransformStamped:
    """Return where a frame is in the plane of its parent."""
    message = TransformStamped()
    message.header.stamp, message.header.frame_id = stamp, parent
    message.child_frame_id = child
    x, y, yaw = map(float, planar)
    message.transform.translation.x, message.transform.translation.y = x, y
    rotation = message.transform.rotation
    rotation.z, rotation.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    return message


def to_path(points: np.ndarray, stamp: Time, frame: str) -> Path:
    """Return the places of a way, shape (n, 2) or (n, 3) [m]; each looks to the next."""
    message = Path()
    message.header.stamp, message.header.frame_id = stamp, frame
    if len(points):
        ahead = np.diff(points[:, :2], axis=0, append=points[-1:, :2])
        yaws = np.arctan2(ahead[:, 1], ahead[:, 0])
        yaws[-1] = yaws[-2] if len(yaws) > 1 else 0.0
        poses = np.column_stack((points[:, :2], yaws))
        message.poses = [to_pose_stamped(pose, stamp, frame) for pose in poses]
    return message


def to_metadata(grid: Grid, stamp: Time) -> MapMetaData:
    """Return the size and place of a grid."""
    message = MapMetaData(map_load_time=stamp, resolution=float(grid.resolution))
    message.height, message.width = grid.cells.shape
    message.origin.position.x, message.origin.position.y = map(float, grid.origin)
    return message


def to_occupancy(grid: Grid, stamp: Time, frame: str) -> OccupancyGrid:
    """Return a grid."""
    message = OccupancyGrid(info=to_metadata(grid, stamp))
    message.header.stamp, message.header.frame_id = stamp, frame
    message.data = array.array('b', np.ascontiguousarray(grid.cells, dtype=np.int8).tobytes())
    return message
