# SPDX-License-Identifier: Apache-2.0
"""Scans, odometry and goals out of messages; maps, paths, poses and transforms into them."""

import array
import math
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import MapMetaData, OccupancyGrid, Path
from nav_msgs.msg import Odometry as OdometryMessage
import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import LaserScan
from wasd_core.errors import InvalidMessage
from wasd_core.messages import to_stamp
from wasd_core.rotations import matrix_from_quaternion, Pose, rpy_from_matrix, yaw_matrix
from wasd_core.topics import has_listener, has_subscriber, LATCHED, RELIABLE, TfBroadcaster

from wasd_navigation.navigator import Navigator
from wasd_navigation.odometry import Odometry
from wasd_navigation.records import Grid, read_tilted_scan, Scan
from wasd_navigation.se2 import compose

# Nothing drives so far [m] or so fast [m/s, rad/s], and no lidar has so many rays.
FARTHEST, FASTEST, MOST_RAYS = 1e6, 1e3, 100_000
# What a longer quaternion says, or one shorter than its inverse, is noise.
LONGEST_QUATERNION = 1e3
# x, y and yaw in a covariance of x, y, z, roll, pitch, yaw, shape (6, 6).
_PLANAR = np.ix_((0, 1, 5), (0, 1, 5))
# Maps are published so often at most [s].
MAP_PERIOD = 1.0
# The way to the goal, which becomes shorter with every step, too [s].
PLAN_PERIOD = 0.2


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


class NavigationPublisher:
    """
    Publishes what a navigator knows, by the frames and times that it is told.

    Maps are drawn for listeners; only the first one is published in any case, for who comes late.
    """

    def __init__(self, node: Node, navigator: Navigator, frame: str) -> None:
        self._node = node
        self._navigator = navigator
        self._frame = frame
        self._map = node.create_publisher(OccupancyGrid, 'map', LATCHED)
        self._metadata = node.create_publisher(MapMetaData, 'map_metadata', LATCHED)
        self._pose = node.create_publisher(PoseWithCovarianceStamped, 'pose', RELIABLE)
        self._plan = node.create_publisher(Path, 'plan', RELIABLE)
        self._local_plan = node.create_publisher(Path, 'local_plan', RELIABLE)
        self._costmap = node.create_publisher(OccupancyGrid, 'global_costmap/costmap', LATCHED)
        self._tf = TfBroadcaster(node)
        self.forget()

    def forget(self) -> None:
        """Begin anew: what was published is old."""
        self._revision: int | None = None
        self._map_at = self._plan_at = -MAP_PERIOD
        self._path = np.empty((0, 2))

    def publish(self, now: float, dated: float, odom_frame: str) -> None:
        """Publish what is due at a time [s]; the transform bears the time `dated` [s]."""
        navigator, stamp = self._navigator, to_stamp(now)
        if navigator.is_placed and self._tf.available:
            correction = navigator.locator.correction
            self._tf.send([to_transform(correction, to_stamp(dated), self._frame, odom_frame)])
        if now - self._map_at >= MAP_PERIOD and navigator.scans:
            self._map_at = now
            self._publish_maps(stamp)
        if now - self._plan_at >= PLAN_PERIOD and has_listener(self._plan):
            path = navigator.pilot.path
            if not np.array_equal(path, self._path):
                self._plan_at, self._path = now, path.copy()
                self._plan.publish(to_path(path, stamp, self._frame))
        if navigator.goal is not None and has_listener(self._local_plan):
            local = navigator.pilot.local_path
            self._local_plan.publish(to_path(local, stamp, self._frame))

    def publish_pose(self, odometry: Odometry, stamp: Time) -> None:
        """Publish where a scan was taken."""
        if has_listener(self._pose):
            locator = self._navigator.locator
            pose = compose(locator.correction, odometry.pose)
            self._pose.publish(to_located(pose, locator.covariance, stamp, self._frame))

    def _publish_maps(self, stamp: Time) -> None:
        locator = self._navigator.locator
        is_wanted = has_listener(self._map) or has_listener(self._metadata)
        if self._revision is None or (is_wanted and self._revision != locator.revision):
            self._revision = locator.revision
            self._map.publish(to_occupancy(locator.grid, stamp, self._frame))
            self._metadata.publish(to_metadata(locator.grid, stamp))
        if self._navigator.goal is not None and has_subscriber(self._node, self._costmap):
            costmap = self._navigator.pilot.costmap
            if costmap is not None:
                self._costmap.publish(to_occupancy(costmap, stamp, self._frame))
