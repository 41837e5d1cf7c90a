# SPDX-License-Identifier: Apache-2.0
"""
Simulates mbot, or any robot with two driven wheels, and drives it from this terminal.

    ros2 launch wasd_bringup mbot.launch.py
    ros2 launch wasd_bringup mbot.launch.py rname:=mbot_kinect world:=room rviz:=true keys:=none
"""

from launch import LaunchDescription
from launch.substitutions import LaunchConfiguration
from launch_ros.parameter_descriptions import ParameterValue
from wasd_bringup.launch_parts import keyboard
from wasd_bringup.launch_parts import robot_arguments
from wasd_bringup.launch_parts import robot_node
from wasd_bringup.launch_parts import robot_nodes
from wasd_bringup.launch_parts import rviz


def generate_launch_description():
    """Return the arguments and the nodes: simulator, controller, frames, keyboard, RViz."""
    robot = ParameterValue(LaunchConfiguration('rname'), value_type=str)
    return LaunchDescription(
        [
            *robot_arguments(rname='mbot', keys='mbot'),
            *robot_nodes(state_rate=100.0),
            robot_node(
                'diff_drive_sim', 'diff_drive_controller', description=robot, use_sim_time=True
            ),
            *keyboard(),
            rviz('mbot'),
        ]
    )
