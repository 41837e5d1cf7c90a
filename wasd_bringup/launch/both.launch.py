# SPDX-License-Identifier: Apache-2.0
"""
Simulates the Go2 and mbot at once, each in a world, a namespace and a time of its own.

    ros2 launch wasd_bringup both.launch.py
    ros2 launch wasd_bringup both.launch.py go2_keys:=none mbot_keys:=mbot

One terminal drives one of them. For both in one world see `wasd both`.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare
from mujoco_sim.parameters import SimulatorParameters
from wasd_bringup.robots import GO2, MBOT
from wasd_bringup.ros.launch_parts import NO_KEYS, parameter_argument

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
        source = PythonLaunchDescriptionSource(
            PathJoinSubstitution(
                [FindPackageShare('wasd_bringup'), 'launch', f'{robot}.launch.py']
            )
        )
        values = {
            'namespace': robot,
            'keys': LaunchConfiguration(f'{robot}_keys'),
            'world': LaunchConfiguration(f'{robot}_world'),
            'description': LaunchConfiguration(f'{robot}_description'),
            'rviz': LaunchConfiguration('rviz'),
            **{name: LaunchConfiguration(name) for name in SHARED},
        }
        # Arguments of an included file stay set after it, unless they have a scope.
        include = IncludeLaunchDescription(source, launch_arguments=values.items())
        included.append(GroupAction([include], scoped=True))
    return LaunchDescription([*arguments, *included])
