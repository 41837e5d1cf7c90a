# SPDX-License-Identifier: Apache-2.0
"""What nodes that steer by a lidar share: sensors in, velocities out."""

from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import LaserScan
from wasd_core.errors import InvalidMessage
from wasd_core.messages import from_odometry, to_seconds
from wasd_core.robot_io import BaseOdometry
from wasd_core.streams import visible
from wasd_core.topics import SENSOR_DATA, tf_message_type, TF_STATIC

from wasd_navigation.messages import from_pose
from wasd_navigation.records import Ranges
from wasd_navigation.senses import Senses


class SensorNode(Node):
    """Takes `odom`, a scan and the lidar's place on /tf_static to `senses`."""

    senses: Senses

    def listen_to_sensors(self, scan_topic: str) -> None:
        """Subscribe to them."""
        self.create_subscription(Odometry, 'odom', self._on_odometry, SENSOR_DATA)
        self.create_subscription(LaserScan, scan_topic, self._on_scan, SENSOR_DATA)
        tf = tf_message_type()
        if tf is not None:
            self.create_subscription(tf, '/tf_static', self._on_fixed_frames, TF_STATIC)

    def take_odometry(self, now: float, base: BaseOdometry, frames: tuple[str, str]) -> None:
        """Take where the base is at a time [s]; `frames` are odom's and the base's."""
        raise NotImplementedError

    def to_velocity(self, velocity: np.ndarray, is_stamped: bool, frame: str) -> Any:
        """Return the message of a velocity, shape (3,), of now in the base's frame."""
        twist = Twist()
        twist.linear.x, twist.linear.y, twist.angular.z = map(float, velocity)
        if not is_stamped:
            return twist
        message = TwistStamped(twist=twist)
        message.header.stamp = self.get_clock().now().to_msg()
        message.header.frame_id = frame
        return message

    def _on_odometry(self, message: Odometry) -> None:
        frames = message.header.frame_id, message.child_frame_id
        self.take_odometry(to_seconds(message.header.stamp), from_odometry(message), frames)

    def _on_scan(self, message: LaserScan) -> None:
        said = Ranges(*(getattr(message, name) for name in Ranges._fields))
        self.senses.take_scan(to_seconds(message.header.stamp), said, message.header.frame_id)

    def _on_fixed_frames(self, message: Any) -> None:
        for one in message.transforms:
            try:
                pose = from_pose(one.transform)
            except InvalidMessage as error:
                self._warn(f'/tf_static: {one.child_frame_id!r}: {error}: ignored')
                continue
            self.senses.place_frame(one.child_frame_id, one.header.frame_id, pose)

    def _warn(self, words: str) -> None:
        self.get_logger().warning(visible(words), throttle_duration_sec=5.0)
