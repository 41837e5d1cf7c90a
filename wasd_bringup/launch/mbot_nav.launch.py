# SPDX-License-Identifier: Apache-2.0
"""
Simulates mbot in a flat, maps it, and drives to where RViz or a client of Nav2 says.

    ros2 launch wasd_bringup mbot_nav.launch.py world:=flat:3 rviz:=true
    ros2 launch wasd_bringup mbot_nav.launch.py world:=flat:3 nav:=nav2
    ros2 launch wasd_bringup mbot_nav.launch.py world:=flat:3 map:=my_flat.yaml
"""

from launch import LaunchDescription
from wasd_bringup.robots import MBOT
from wasd_bringup.ros.launch_parts import navigation


def generate_launch_description():
    """Return the arguments and the nodes: robot, mux, keyboard, navigation."""
    return LaunchDescription(navigation(MBOT))
