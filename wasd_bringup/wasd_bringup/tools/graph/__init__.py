# SPDX-License-Identifier: Apache-2.0
"""A short look into the ROS graph: what is running, found by name, with public rclpy only."""

from wasd_bringup.tools.graph.rate import RateMeter
from wasd_bringup.tools.graph.ros_graph import find_type, full_name

__all__ = ['RateMeter', 'find_type', 'full_name']
