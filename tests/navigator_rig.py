# SPDX-License-Identifier: Apache-2.0
"""A robot's navigator of stand-ins with its node, and what both are given."""

import math

from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
import numpy as np
from sensor_msgs.msg import LaserScan
from wasd_core.rotations import Pose
from wasd_navigation.messages import to_pose_stamped

LEVEL = Pose(np.array([0.1, 0.0, 0.2]), np.eye(3))


def odometry_at(stamp, x=0.0, yaw=0.0):
    message = Odometry(child_frame_id='base')
    message.header.frame_id = 'odom'
    message.header.stamp = stamp
    message.pose.pose.position.x = x
    message.pose.pose.orientation.z = math.sin(0.5 * yaw)
    message.pose.pose.orientation.w = math.cos(0.5 * yaw)
    return message


def scan_at(stamp):
    message = LaserScan(angle_min=-1.0, angle_max=1.0, angle_increment=1.0, ranges=[1.0, 2.0, 3.0])
    message.range_min, message.range_max = 0.1, 6.0
    message.header.frame_id, message.header.stamp = 'laser', stamp
    return message


class Rig:
    """A navigator that has seen a scan, its node, and what it commands and says."""

    def __init__(self, node):
        self.node, self.sent, self.said = node, [], []
        self.navigation, self.navigator = node.navigation, node.navigator
        self.navigation.send = lambda velocity: self.sent.append(velocity.tolist())
        self.navigation.say = self.said.append
        self.navigation.senses.place_frame('laser', 'base', LEVEL)
        self.look()

    def look(self, x=0.0, **scan):
        """Take odometry and a scan of now, in which some fields are other ones."""
        now = self.node.get_clock().now().to_msg()
        self.node._on_odometry(odometry_at(now, x))
        message = scan_at(now)
        for name, value in scan.items():
            setattr(message, name, value)
        self.node._on_scan(message)


def goal_at(x, y, yaw, frame='map'):
    return to_pose_stamped(np.array([x, y, yaw]), Odometry().header.stamp, frame)


def located(x, y):
    message = PoseWithCovarianceStamped()
    message.header.frame_id = 'map'
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.covariance[0] = 0.25
    return message
