# SPDX-License-Identifier: Apache-2.0
"""A short look into the ROS graph: what is running, found by name, with public rclpy only."""
