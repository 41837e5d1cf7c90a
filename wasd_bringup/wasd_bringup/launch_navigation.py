# SPDX-License-Identifier: Apache-2.0
"""
A robot that maps and drives to a point, in a sourced ROS: by our navigator, or others' nodes.

Keys drive, too, and come first: they and the navigation are sources of twist_mux.
"""

from typing import Any

from launch.actions import DeclareLaunchArgument
from launch.actions import GroupAction
from launch.actions import IncludeLaunchDescription
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import AndSubstitution
from launch.substitutions import EqualsSubstitution
from launch.substitutions import LaunchConfiguration
from launch.substitutions import NotEqualsSubstitution
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from wasd_bringup.launch_parts import keyboard
from wasd_bringup.launch_parts import NO_KEYS
from wasd_bringup.launch_parts import robot_arguments
from wasd_bringup.robots import RobotRow

BUILTIN, NAV2 = 'builtin', 'nav2'
# Nav2's nodes, package and executable, as its own launch files start them, but for the docking.
NAVIGATION = {
    'controller_server': 'nav2_controller',
    'smoother_server': 'nav2_smoother',
    'planner_server': 'nav2_planner',
    'behavior_server': 'nav2_behaviors',
    'velocity_smoother': 'nav2_velocity_smoother',
    'collision_monitor': 'nav2_collision_monitor',
    'bt_navigator': 'nav2_bt_navigator',
}
LOCALISATION = {'map_server': 'nav2_map_server', 'amcl': 'nav2_amcl'}
# What velocities go through on their way to the mux: Nav2's own names.
REMAPPED = {
    'controller_server': [('cmd_vel', 'cmd_vel_nav')],
    'behavior_server': [('cmd_vel', 'cmd_vel_nav')],
    'velocity_smoother': [('cmd_vel', 'cmd_vel_nav')],
}
# Arguments of a robot's own launch file that are passed on to it.
PASSED_ON = ('description', 'world', 'seed', 'speed', 'params_file', 'rviz')


def navigation(robot: RobotRow, *others: str) -> list[Any]:
    """Return a robot with its mux, its keyboard and what navigates; `others` are Nav2's files."""
    is_nav2 = EqualsSubstitution(LaunchConfiguration('nav'), NAV2)
    has_map = NotEqualsSubstitution(LaunchConfiguration('map'), '')
    maps = EqualsSubstitution(LaunchConfiguration('map'), '')
    files = [_file(name) for name in ('nav2.yaml', *others)]
    return [
        *(each for each in robot_arguments(robot) if each.name != 'namespace'),
        DeclareLaunchArgument(
            'namespace', default_value='', description='None, with navigation.', choices=['']
        ),
        DeclareLaunchArgument(
            'nav',
            default_value=BUILTIN,
            description='Who maps and drives: the navigator of this project, or slam_toolbox and '
            'Nav2, which are to be installed.',
            choices=[BUILTIN, NAV2],
        ),
        DeclareLaunchArgument(
            'map', default_value='', description="A saved map, FILE.yaml; '': it maps."
        ),
        _robot(robot),
        Node(
            package='teleop_keyboard',
            executable='twist_mux',
            output='screen',
            parameters=[{'use_sim_time': True}],
            remappings=[('cmd_vel_out', 'cmd_vel')],
        ),
        *keyboard(cmd_vel='key_vel'),
        Node(
            package='wasd_navigation',
            executable='navigator',
            output='screen',
            parameters=[
                _file(f'navigator_{robot.name}.yaml'),
                {'use_sim_time': True, 'map': _text('map')},
            ],
            remappings=[('cmd_vel', 'nav_vel')],
            condition=IfCondition(EqualsSubstitution(LaunchConfiguration('nav'), BUILTIN)),
        ),
        *_managed('navigation', NAVIGATION, files, IfCondition(is_nav2)),
        *_managed(
            'localization', LOCALISATION, files, IfCondition(AndSubstitution(is_nav2, has_map))
        ),
        _slam_toolbox(robot, IfCondition(AndSubstitution(is_nav2, maps))),
    ]


def _file(name: str) -> PathJoinSubstitution:
    return PathJoinSubstitution([FindPackageShare('wasd_bringup'), 'config', name])


def _robot(robot: RobotRow) -> GroupAction:
    """Return the robot's own launch file, without its keyboard."""
    path = [FindPackageShare('wasd_bringup'), 'launch', f'{robot.name}.launch.py']
    values = {name: LaunchConfiguration(name) for name in PASSED_ON} | {'keys': NO_KEYS}
    source = PythonLaunchDescriptionSource(PathJoinSubstitution(path))
    # Arguments of an included file stay set after it, unless they have a scope.
    include = IncludeLaunchDescription(source, launch_arguments=values.items())
    return GroupAction([include], scoped=True)


def _managed(
    group: str, nodes: dict[str, str], files: list[Any], condition: IfCondition
) -> list[Node]:
    """Return nodes of Nav2 with their parameter files, and what activates them in this order."""
    common = {'use_sim_time': True}
    asked = {'map_server': {'yaml_filename': _text('map')}}
    started = [
        Node(
            package=package,
            executable=name,
            name=name,
            output='screen',
            parameters=[*files, common | asked.get(name, {})],
            remappings=REMAPPED.get(name, []),
            condition=condition,
        )
        for name, package in nodes.items()
    ]
    manager = Node(
        package='nav2_lifecycle_manager',
        executable='lifecycle_manager',
        name=f'lifecycle_manager_{group}',
        output='screen',
        parameters=[common | {'autostart': True, 'node_names': list(nodes)}],
        condition=condition,
    )
    return [*started, manager]


def _slam_toolbox(robot: RobotRow, condition: IfCondition) -> IncludeLaunchDescription:
    """Return slam_toolbox' own launch file, which also activates it, with our parameters."""
    path = [FindPackageShare('slam_toolbox'), 'launch', 'online_async_launch.py']
    values = {'use_sim_time': 'true', 'slam_params_file': _file(f'slam_toolbox_{robot.name}.yaml')}
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(PathJoinSubstitution(path)),
        launch_arguments=values.items(),
        condition=condition,
    )


def _text(argument: str) -> ParameterValue:
    return ParameterValue(LaunchConfiguration(argument), value_type=str)
