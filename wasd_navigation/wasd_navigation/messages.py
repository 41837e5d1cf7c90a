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

# Nothing drives so far [m] or so fast [m/s, rad/s], and no lidar has so many rays.
FARTHEST, FASTEST, MOST_RAYS = 1e6, 1e3, 100_000
# What a longer quaternion says, or one shorter than its inverse, is noise.
LONGEST_QUATERNION = 1e3
# x, y and yaw in a covariance of x, y, z, roll, pitch, yaw, shape (6, 6).
_PLANAR = np.ix_((0, 1, 5), (0, 1, 5))


def from_pose(pose: Any) -> Pose:
    """
    Return a geometry_msgs/Pose, or a Transform.

    Raises:
        InvalidMessage: a number is not finite, a place out of the world, the orientation 0.
    """
    p = getattr(pose, 'position', None) or pose.translation
    q = getattr(pose, 'orientation', None) or pose.rotation
    numbers = (p.x, p.y, p.z, q.w, q.x, q.y, q.z)
    length = math.hypot(*numbers[3:])
    if not all(map(math.isfinite, numbers)) or not length > 1.0 / LONGEST_QUATERNION:
        raise InvalidMessage('wanted a pose of finite numbers and an orientation that is not 0')
    if max(map(abs, numbers[:3])) > FARTHEST or length > LONGEST_QUATERNION:
        raise InvalidMessage(f'wanted a pose within {1e-3 * FARTHEST:.0f} km, of unit orientation')
    return Pose(np.array(numbers[:3]), matrix_from_quaternion(np.array(numbers[3:])))


def to_planar(pose: Pose) -> np.ndarray:
    """Return x, y [m] and yaw [rad] of a pose, shape (3,)."""
    return np.array([*pose.position[:2], rpy_from_matrix(pose.rotation)[2]])


def from_odometry(message: OdometryMessage) -> Odometry:
    """
    Return odometry as seen from above.

    Raises:
        InvalidMessage: a number is not finite, or is out of the world.
    """
    pose = from_pose(message.pose.pose)
    planar = to_planar(pose)
    level = Pose(
        np.array([0.0, 0.0, pose.position[2]]), yaw_matrix(-float(planar[2])) @ pose.rotation
    )
    twist = message.twist.twist
    velocity = np.array([twist.linear.x, twist.linear.y, twist.angular.z])
    if not (np.abs(velocity) <= FASTEST).all():
        raise InvalidMessage(f'wanted a velocity of at most {FASTEST:.0f} m/s, got {velocity}')
    covariance = from_covariance(message.pose.covariance)
    return Odometry(planar, velocity, covariance, level)


def from_covariance(numbers: Any) -> np.ndarray:
    """
    Return the covariance of x, y and yaw, shape (3, 3), out of that of a pose, 36 numbers.

    Raises:
        InvalidMessage: a number of it is not finite.
    """
    covariance: np.ndarray = np.array(numbers, dtype=float).reshape(6, 6)[_PLANAR]
    if not np.isfinite(covariance).all():
        raise InvalidMessage('wanted a covariance of finite numbers')
    bounded: np.ndarray = covariance.clip(-(FARTHEST**2), FARTHEST**2)
    return bounded


def from_scan(message: LaserScan, mount: Pose) -> Scan:
    """
    Return the rays of a scan; `mount` is the lidar's pose in the level frame below the base.

    Raises:
        InvalidMessage: its angles or limits are not finite, or it has more rays than any lidar.
    """
    said = (message.angle_min, message.angle_increment, message.range_min, message.range_max)
    if not all(map(math.isfinite, said)) or not message.range_max > 0.0:
        raise InvalidMessage(
            'wanted finite angles and limits, the greatest range above 0 m; angle_min, '
            f'angle_increment, range_min and range_max are {", ".join(map(str, said))}'
        )
    if len(message.ranges) > MOST_RAYS:
        raise InvalidMessage(f'wanted at most {MOST_RAYS} rays, got {len(message.ranges)}')
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
