# SPDX-License-Identifier: Apache-2.0
"""
Simulates the Go2, or any robot with such legs, and walks it from this terminal.

    ros2 launch wasd_bringup go2.launch.py description:=go2
    ros2 launch wasd_bringup go2.launch.py world:=slope:10 rviz:=true keys:=none

Its own keys: 2 stands, 4 trots, then w a s d; 2 and 5 let it follow cmd_vel.
"""

from launch import LaunchDescription
from quadruped_sim.parameters import LegNodeParameters
from wasd_bringup.robots import GO2
from wasd_bringup.ros.launch_parts import (
    keyboard,
    parameter_argument,
    parameter_value,
    robot_arguments,
    robot_node,
    robot_nodes,
    rviz,
    text,
)


def generate_launch_description():
    """Return the arguments and the nodes: simulator, controller, frames, keyboard, RViz."""
    names = ('estimator', 'limits', 'gait')
    asked = {name: parameter_value(LegNodeParameters, name) for name in names}
    return LaunchDescription(
        [
            *robot_arguments(GO2),
            *(parameter_argument(LegNodeParameters, name) for name in asked),
            *robot_nodes(),
            robot_node(
                'quadruped_sim', 'leg_controller', description=text('description'), **asked
            ),
            *keyboard(),
            rviz(GO2),
        ]
    )
