# SPDX-License-Identifier: Apache-2.0
"""
Shared parts of the launch files: arguments, and the nodes around a controller.

Everything that a namespace should keep apart is renamed to a relative name: in the namespace
`go2` the robot has a clock and a tree of frames of its own, /go2/clock and /go2/tf; `wasd` with
such a namespace does the same.

A robot that maps and drives to a point does so by our navigator, or by others' nodes. Keys drive,
too, and come first: they and the navigation are sources of twist_mux.
"""

from typing import Any

from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription, Shutdown
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import (
    AndSubstitution,
    EqualsSubstitution,
    LaunchConfiguration,
    NotEqualsSubstitution,
    PathJoinSubstitution,
)
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare
from mujoco_sim.parameters import SimulatorParameters
from wasd_core.parameters import known_parameters, Parameters

from wasd_bringup.robots import RobotRow, unitree_help, UNITREE_PRESET
from wasd_bringup.run.options import NAMESPACED

UNITREE_HELP = '\n'.join(unitree_help('qwerty'))
# Values of the argument `keys` that are no keymap.
KEYS_OF_THE_ROBOT, NO_KEYS = UNITREE_PRESET, 'none'


def parameter_argument(definition: type[Parameters], name: str) -> DeclareLaunchArgument:
    """Return the launch argument that sets a parameter."""
    field = known_parameters(definition)[name].field
    choices = field.metadata['choices']
    return DeclareLaunchArgument(
        name,
        default_value=str(field.default),
        description=field.metadata['doc'],
        choices=list(choices) if choices else None,
    )


def parameter_value(definition: type[Parameters], name: str) -> ParameterValue:
    """Return what an argument gives a parameter: of its type, whatever the text looks like."""
    field = known_parameters(definition)[name].field
    return ParameterValue(LaunchConfiguration(name), value_type=type(field.default))


def text(argument: str) -> ParameterValue:
    """Return what an argument gives a parameter that is a text."""
    return ParameterValue(LaunchConfiguration(argument), value_type=str)


def robot_arguments(robot: RobotRow) -> list[DeclareLaunchArgument]:
    """Return the arguments that all robots have, with the defaults of one."""
    path = [FindPackageShare('wasd_bringup'), 'launch', 'no_parameters.yaml']
    return [
        DeclareLaunchArgument(
            'rname',
            default_value=robot.description,
            description="The tutorial's name for `description`.",
        ),
        DeclareLaunchArgument(
            'description',
            default_value=LaunchConfiguration('rname'),
            description='Robot: a name, or a xacro or URDF file.',
        ),
        DeclareLaunchArgument(
            'params_file',
            default_value=PathJoinSubstitution(path),
            description="ROS parameters of the robot's nodes; they come before other arguments.",
        ),
        *(parameter_argument(SimulatorParameters, name) for name in ('world', 'seed', 'speed')),
        DeclareLaunchArgument(
            'namespace',
            default_value='',
            description='Namespace of all nodes, topics, clock and tf.',
        ),
        DeclareLaunchArgument(
            'keys',
            default_value=robot.preset,
            description='Keyboard of this terminal: a keymap (see `wasd keys`), '
            f'{KEYS_OF_THE_ROBOT} for the keys of the Go2 itself, {NO_KEYS} for no keyboard.',
        ),
        DeclareLaunchArgument('rviz', default_value='false', description='Start RViz.'),
    ]


def robot_node(
    package: str,
    executable: str,
    condition: IfCondition | None = None,
    use_sim_time: Any = True,
    **parameters: Any,
) -> Node:
    """
    Return a node with parameters, and those of the user's file on top.

    Without it nothing drives: its end is the end of the launch, which says whose it was.
    """
    return Node(
        package=package,
        executable=executable,
        namespace=LaunchConfiguration('namespace'),
        output='screen',
        parameters=[
            parameters | {'use_sim_time': use_sim_time},
            LaunchConfiguration('params_file'),
        ],
        remappings=list(NAMESPACED),
        condition=condition,
        on_exit=Shutdown(),
    )


def robot_nodes(
    has_physics: IfCondition | None = None, use_sim_time: Any = True, **both: Any
) -> list[Node]:
    """
    Return simulator and state publisher; `both` are parameters of both.

    Where there may be no physics, there is no simulator then, and no simulated time.
    """
    both['description'] = text('description')
    names = ('world', 'seed', 'speed')
    asked = {name: parameter_value(SimulatorParameters, name) for name in names}
    return [
        robot_node('mujoco_sim', 'simulator', has_physics, **asked, **both),
        robot_node('robot_description', 'state_publisher', use_sim_time=use_sim_time, **both),
    ]


def keyboard(use_sim_time: Any = True, cmd_vel: str = 'cmd_vel') -> list[Node]:
    """
    Return what reads this terminal; launch gives a node no input, both open /dev/tty.

    Keys that become velocities are sent to `cmd_vel`.
    """
    keys = LaunchConfiguration('keys')
    is_keymap = AndSubstitution(
        NotEqualsSubstitution(keys, KEYS_OF_THE_ROBOT), NotEqualsSubstitution(keys, NO_KEYS)
    )
    common = {
        'package': 'teleop_keyboard',
        'namespace': LaunchConfiguration('namespace'),
        'output': 'screen',
        'remappings': list(NAMESPACED),
    }
    renamed = [('cmd_vel', cmd_vel)] if cmd_vel != 'cmd_vel' else []
    preset = {'preset': text('keys'), 'use_sim_time': use_sim_time}
    return [
        Node(
            executable='key_publisher',
            parameters=[{'help': ParameterValue(UNITREE_HELP, value_type=str)}],
            condition=IfCondition(EqualsSubstitution(keys, KEYS_OF_THE_ROBOT)),
            **common,
        ),
        Node(
            executable='teleop',
            parameters=[preset],
            condition=IfCondition(is_keymap),
            **common | {'remappings': [*NAMESPACED, *renamed]},
        ),
    ]


def rviz(robot: RobotRow, use_sim_time: Any = True) -> Node:
    """Return RViz with the configuration of a robot."""
    path = PathJoinSubstitution([FindPackageShare('wasd_bringup'), 'rviz', f'{robot.name}.rviz'])
    return Node(
        package='rviz2',
        executable='rviz2',
        namespace=LaunchConfiguration('namespace'),
        parameters=[{'use_sim_time': use_sim_time}],
        remappings=list(NAMESPACED),
        arguments=['-d', path],
        condition=IfCondition(LaunchConfiguration('rviz')),
    )


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
    passed_on = {name: LaunchConfiguration(name) for name in PASSED_ON}
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
        include_robot(robot.name, passed_on | {'keys': NO_KEYS}),
        Node(
            package='teleop_keyboard',
            executable='twist_mux',
            output='screen',
            parameters=[{'use_sim_time': True}],
            remappings=[('cmd_vel_out', 'cmd_vel')],
            on_exit=Shutdown(),
        ),
        *keyboard(cmd_vel='key_vel'),
        Node(
            package='wasd_navigation',
            executable='navigator',
            output='screen',
            parameters=[
                _file(f'navigator_{robot.name}.yaml'),
                {'use_sim_time': True, 'map': text('map')},
            ],
            remappings=[('cmd_vel', 'nav_vel')],
            condition=IfCondition(EqualsSubstitution(LaunchConfiguration('nav'), BUILTIN)),
            on_exit=Shutdown(),
        ),
        *_managed('navigation', NAVIGATION, files, IfCondition(is_nav2)),
        *_managed(
            'localization', LOCALISATION, files, IfCondition(AndSubstitution(is_nav2, has_map))
        ),
        _slam_toolbox(robot, IfCondition(AndSubstitution(is_nav2, maps))),
    ]


def _file(name: str) -> PathJoinSubstitution:
    return PathJoinSubstitution([FindPackageShare('wasd_bringup'), 'config', name])


def include_robot(name: str, values: dict[str, Any]) -> GroupAction:
    """Return a robot's own launch file with values of its arguments."""
    path = [FindPackageShare('wasd_bringup'), 'launch', f'{name}.launch.py']
    source = PythonLaunchDescriptionSource(PathJoinSubstitution(path))
    # Arguments of an included file stay set after it, unless they have a scope.
    include = IncludeLaunchDescription(source, launch_arguments=values.items())
    return GroupAction([include], scoped=True)


def _managed(
    group: str, nodes: dict[str, str], files: list[Any], condition: IfCondition
) -> list[Node]:
    """Return nodes of Nav2 with their parameter files, and what activates them in this order."""
    common = {'use_sim_time': True}
    asked = {'map_server': {'yaml_filename': text('map')}}
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
