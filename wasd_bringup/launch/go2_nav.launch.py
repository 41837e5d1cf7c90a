# SPDX-License-Identifier: Apache-2.0
"""
Simulates the Go2 in a flat, maps it, and drives to where RViz or a client of Nav2 says.

    ros2 launch wasd_bringup go2_nav.launch.py world:=flat:3 rviz:=true
    ros2 launch wasd_bringup go2_nav.launch.py world:=flat:3 nav:=nav2
    ros2 launch wasd_bringup go2_nav.launch.py world:=flat:3 map:=my_flat.yaml

Press 2 and 5 first: it stands up and follows velocities then.
"""

from launch import LaunchDescription
from wasd_bringup.robots import GO2
from wasd_bringup.ros.launch_parts import navigation


def generate_launch_description():
    """Return the arguments and the nodes: robot, mux, keyboard, navigation."""
    return LaunchDescription(navigation(GO2, 'nav2_go2.yaml'))
