# SPDX-License-Identifier: Apache-2.0
"""What the navigator tells: map -> odom, the map, its pose in it, the plan, a cost map."""

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import MapMetaData
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path
import numpy as np
from rclpy.node import Node
from wasd_core.messages import to_stamp
from wasd_core.topics import has_listener
from wasd_core.topics import has_subscriber
from wasd_core.topics import LATCHED
from wasd_core.topics import RELIABLE
from wasd_core.topics import TfBroadcaster

from wasd_navigation.messages import to_located
from wasd_navigation.messages import to_metadata
from wasd_navigation.messages import to_occupancy
from wasd_navigation.messages import to_path
from wasd_navigation.messages import to_transform
from wasd_navigation.navigator import Navigator
from wasd_navigation.odometry_memory import Odometry
from wasd_navigation.se2 import compose

# Maps are published so often at most [s].
MAP_PERIOD = 1.0
# The way to the goal, which becomes shorter with every step, too [s].
PLAN_PERIOD = 0.2


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
