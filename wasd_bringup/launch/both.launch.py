# SPDX-License-Identifier: Apache-2.0
"""
Simulates the Go2 and mbot at once, each in a world, a namespace and a time of its own.

    ros2 launch wasd_bringup both.launch.py
    ros2 launch wasd_bringup both.launch.py go2_keys:=none mbot_keys:=mbot

One terminal drives one of them. For both in one world see `wasd both`.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from mujoco_sim.parameters import SimulatorParameters
from wasd_bringup.robots import GO2, MBOT
from wasd_bringup.ros.launch_parts import include_robot, NO_KEYS, parameter_argument

# What is the same for both.
SHARED = ('seed', 'speed')
# The keys of each robot by default: the keyboard drives the Go2.
KEYS = {GO2.name: GO2.preset, MBOT.name: NO_KEYS}


def generate_launch_description():
    """Return the arguments and the launch files of the two robots."""
    arguments = [
        DeclareLaunchArgument('rviz', default_value='false', description='Start RViz twice.'),
        *(parameter_argument(SimulatorParameters, name) for name in SHARED),
    ]
    included = []
    for robot, keys in KEYS.items():
        arguments += [
            DeclareLaunchArgument(f'{robot}_keys', default_value=keys, description='As its keys.'),
            DeclareLaunchArgument(
                f'{robot}_world', default_value='flat', description='Its world.'
            ),
            DeclareLaunchArgument(
                f'{robot}_description',
                default_value=robot,
                description='A robot of its kind: a name, or a xacro or URDF file.',
            ),
        ]
        values = {
            'namespace': robot,
            'keys': LaunchConfiguration(f'{robot}_keys'),
            'world': LaunchConfiguration(f'{robot}_world'),
            'description': LaunchConfiguration(f'{robot}_description'),
            'rviz': LaunchConfiguration('rviz'),
            **{name: LaunchConfiguration(name) for name in SHARED},
        }
        included.append(include_robot(robot, values))
    return LaunchDescription([*arguments, *included])
