# SPDX-License-Identifier: Apache-2.0
"""Publishes the heights around a robot, and takes clouds from a topic, while somebody listens."""

from collections.abc import Callable

from builtin_interfaces.msg import Time
import numpy as np
from rclpy.node import Node
from robot_description.morphology.quadruped import poses_in_base
from robot_description.robot import Robot
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header
from wasd_core.messages import CLOUD_TYPES, to_cloud, to_seconds
from wasd_core.robot_io import BaseOdometry
from wasd_core.rotations import yaw_of
from wasd_core.streams import visible
from wasd_core.topics import has_subscriber, RELIABLE, SENSOR_DATA

from quadruped_sim.elevation import Elevation
from quadruped_sim.elevation_mapper import ElevationMapper
from quadruped_sim.height_scan import COLUMNS, height_scan, ROWS, scan_places

# What PointField's types of a cloud's fields are called by numpy.
_FORMATS = {number: name for name, number in CLOUD_TYPES.items()}


class ElevationPublisher:
    """
    The topics `elevation` and `height_scan`, clouds of so many rows as they have along y.

    `is_wanted` says whether somebody had subscribed to either when last `look` was called; a
    recording of everything does not count.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._map = node.create_publisher(PointCloud2, 'elevation', RELIABLE)
        self._scan = node.create_publisher(PointCloud2, 'height_scan', RELIABLE)
        self.is_wanted = False

    def look(self) -> None:
        """Look whether somebody has subscribed."""
        topics = (self._map, self._scan)
        self.is_wanted = any(has_subscriber(self._node, topic) for topic in topics)

    def publish_map(self, elevation: Elevation, frame: str, stamp: Time) -> None:
        """Publish each cell's middle, its height and the height's variance; NaN for unknown."""
        if has_subscriber(self._node, self._map):
            along = (np.arange(elevation.count) + 0.5) * elevation.resolution
            x, y = np.meshgrid(*(elevation.corner[:, None] + along))
            layers = {'x': x, 'y': y, 'z': elevation.heights(), 'variance': elevation.variances()}
            self._map.publish(_to_cloud(layers, Header(stamp=stamp, frame_id=frame)))

    def publish_scan(
        self, elevation: Elevation, odometry: BaseOdometry, frame: str, stamp: Time
    ) -> None:
        """Publish the places of a height scan, and its values for policies."""
        if has_subscriber(self._node, self._scan):
            position = odometry.position
            yaw = yaw_of(odometry.orientation)
            x, y = scan_places(position, yaw).T
            layers = {
                'x': x,
                'y': y,
                'z': elevation.at(x, y),
                'scan': height_scan(elevation.at, position, yaw),
            }
            shaped = {name: values.reshape(ROWS, COLUMNS) for name, values in layers.items()}
            self._scan.publish(_to_cloud(shaped, Header(stamp=stamp, frame_id=frame)))


class CloudInput:
    """Makes a map of the topic `points` while it is `wanted`; `on_map` hears of each cloud."""

    def __init__(
        self,
        node: Node,
        robot: Robot,
        wanted: Callable[[], bool],
        on_map: Callable[[Elevation, Time], None],
    ) -> None:
        self._node, self._robot, self._wanted, self._on_map = node, robot, wanted, on_map
        self._clouds: object | None = None  # the subscription
        self.mapper: ElevationMapper | None = None

    def step(self, time: float, odometry: BaseOdometry) -> None:
        """Take where the robot believes to be at a time [s], and look who listens."""
        is_wanted = self._wanted()
        if is_wanted and self._clouds is None:
            self._clouds = self._node.create_subscription(
                PointCloud2, 'points', self._on_cloud, SENSOR_DATA
            )
        elif not is_wanted and self._clouds is not None:
            self._node.destroy_subscription(self._clouds)  # type: ignore[arg-type]
            self._clouds = None
        if is_wanted and self.mapper is not None:
            self.mapper.take_pose(time, odometry.position, odometry.orientation)

    def _on_cloud(self, message: PointCloud2) -> None:
        if self.mapper is None:
            robot, link = self._robot, message.header.frame_id
            if robot.carriers.get(link) != robot.carriers[robot.base]:
                self._node.get_logger().warning(
                    visible(f'points: {link} is no link fixed to the base: no heights by it'),
                    once=True,
                )
                return
            self.mapper = ElevationMapper(poses_in_base(robot)[link])
        points = to_points(message)
        if points is not None and self.mapper.take_cloud(to_seconds(message.header.stamp), points):
            self._on_map(self.mapper.elevation, message.header.stamp)


def to_points(message: PointCloud2) -> np.ndarray | None:
    """Return a cloud's points as an array with its fields; None where x y z or time is missing."""
    fields = [field for field in message.fields if field.datatype in _FORMATS]
    names = [field.name for field in fields]
    count = message.width * message.height
    is_whole = len(message.data) == count * message.point_step and not message.is_bigendian
    if not {'x', 'y', 'z', 'time'} <= set(names) or not is_whole:
        return None
    try:
        kind = np.dtype(
            {
                'names': names,
                'formats': [_FORMATS[field.datatype] for field in fields],
                'offsets': [field.offset for field in fields],
                'itemsize': message.point_step,
            }
        )
    except ValueError:  # fields that do not lie in a point
        return None
    return np.frombuffer(message.data, kind)


def _to_cloud(layers: dict[str, np.ndarray], header: Header) -> PointCloud2:
    """Return layers of one shape (rows, columns) as the fields of a cloud."""
    points = np.empty(layers['x'].shape, [(name, '<f4') for name in layers])
    for name, values in layers.items():
        points[name] = values
    return to_cloud(points, header, is_dense=False)
