# SPDX-License-Identifier: Apache-2.0
"""
Simulates mbot, or any robot with two driven wheels, and drives it from this terminal.

    ros2 launch wasd_bringup mbot.launch.py
    ros2 launch wasd_bringup mbot.launch.py description:=mbot_kinect world:=room rviz:=true
    ros2 launch wasd_bringup mbot.launch.py mode:=arbotix controller:=my_drive.yaml

In mode fake there is no simulator, so no /clock: all nodes go by wall time.
"""

from diff_drive_sim.parameters import MODES
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, NotEqualsSubstitution
from launch_ros.parameter_descriptions import ParameterValue
from wasd_bringup.robots import MBOT
from wasd_bringup.ros.launch_parts import (
    keyboard,
    robot_arguments,
    robot_node,
    robot_nodes,
    rviz,
    text,
)


def generate_launch_description():
    """Return the arguments and the nodes: simulator, controller, frames, keyboard, RViz."""
    has_physics = NotEqualsSubstitution(LaunchConfiguration('mode'), 'fake')
    use_sim_time = ParameterValue(has_physics, value_type=bool)
    return LaunchDescription(
        [
            *robot_arguments(MBOT),
            DeclareLaunchArgument(
                'mode',
                default_value='',
                description="What turns the wheels: as `wasd mbot --mode`; '': as the file says.",
                choices=['', *MODES],
            ),
            DeclareLaunchArgument(
                'controller',
                default_value='',
                description="YAML with the drive's parameters, as `wasd mbot --controller`.",
            ),
            *robot_nodes(IfCondition(has_physics), use_sim_time, controller=text('controller')),
            robot_node(
                'diff_drive_sim',
                'diff_drive_controller',
                description=text('description'),
                mode=text('mode'),
                controller=text('controller'),
                use_sim_time=use_sim_time,
            ),
            *keyboard(use_sim_time),
            rviz(MBOT, use_sim_time),
        ]
    )
