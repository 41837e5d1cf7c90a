# SPDX-License-Identifier: Apache-2.0
"""Scans, odometry and goals out of messages; maps, paths, poses and transforms into them."""

import array
import math
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import MapMetaData, OccupancyGrid, Path
import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import LaserScan
from wasd_core.errors import InvalidMessage
from wasd_core.messages import to_seconds, to_stamp
from wasd_core.rotations import Pose
from wasd_core.topics import (
    has_listener,
    has_subscriber,
    LATCHED,
    RELIABLE,
    tf_message_type,
    TF_STATIC,
    TfBroadcaster,
)

from wasd_navigation.navigator import Navigator
from wasd_navigation.odometry import Odometry, PLANAR, read_pose
from wasd_navigation.records import Grid, Ranges
from wasd_navigation.se2 import compose
from wasd_navigation.senses import Senses

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
    return read_pose(np.array((p.x, p.y, p.z)), np.array((q.w, q.x, q.y, q.z)))


def take_scan(message: LaserScan, senses: Senses) -> None:
    """Tell senses a scan."""
    said = Ranges(*(getattr(message, name) for name in Ranges._fields))
    senses.take_scan(to_seconds(message.header.stamp), said, message.header.frame_id)


def hear_fixed_frames(node: Node, senses: Senses) -> None:
    """Tell senses of a node what /tf_static says; without its type there is no such topic."""
    tf = tf_message_type()
    if tf is not None:
        node.create_subscription(
            tf, '/tf_static', lambda said: take_fixed_frames(said, senses), TF_STATIC
        )


def take_fixed_frames(message: Any, senses: Senses) -> None:
    """Tell senses where frames of /tf_static are, and of the others that they are ignored."""
    for one in message.transforms:
        try:
            pose = from_pose(one.transform)
        except InvalidMessage as error:
            senses.warn(f'/tf_static: {one.child_frame_id!r}: {error}: ignored')
            continue
        senses.place_frame(one.child_frame_id, one.header.frame_id, pose)


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
    whole[PLANAR] = covariance
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
    Publishes what a navigator knows, in given frames and at given times.

    Maps are drawn for listeners; only the first is always published, for late subscribers.
    """

    def __init__(self, node: Node, navigator: Navigator, frame: str) -> None:
        self._node = node
        self._navigator = navigator
        self._frame = frame
        self._map = node.create_publisher(OccupancyGrid, 'map', LATCHED)
        self._metadata = node.create_publisher(MapMetaData, 'map_metadata', LATCHED)
        self._keepout = node.create_publisher(OccupancyGrid, 'keepout_filter_mask', LATCHED)
        self._pose = node.create_publisher(PoseWithCovarianceStamped, 'pose', RELIABLE)
        self._plan = node.create_publisher(Path, 'plan', RELIABLE)
        self._local_plan = node.create_publisher(Path, 'local_plan', RELIABLE)
        self._costmap = node.create_publisher(OccupancyGrid, 'global_costmap/costmap', LATCHED)
        self._tf = TfBroadcaster(node)
        self.forget()

    def forget(self) -> None:
        """Begin again: what was published is old."""
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

    def publish_pose(self, now: float, odometry: Odometry) -> None:
        """Publish where a scan of a time [s] was taken."""
        if has_listener(self._pose):
            locator = self._navigator.locator
            pose = compose(locator.correction, odometry.pose)
            self._pose.publish(to_located(pose, locator.covariance, to_stamp(now), self._frame))

    def _publish_maps(self, stamp: Time) -> None:
        locator = self._navigator.locator
        is_wanted = has_listener(self._map) or has_listener(self._metadata)
        if self._revision is None and (keepout := self._navigator.keepout) is not None:
            self._keepout.publish(to_occupancy(keepout.mask, stamp, self._frame))
        if self._revision is None or (is_wanted and self._revision != locator.revision):
            self._revision = locator.revision
            self._map.publish(to_occupancy(locator.grid, stamp, self._frame))
            self._metadata.publish(to_metadata(locator.grid, stamp))
        if self._navigator.goal is not None and has_subscriber(self._node, self._costmap):
            costmap = self._navigator.pilot.costmap
            if costmap is not None:
                self._costmap.publish(to_occupancy(costmap, stamp, self._frame))
