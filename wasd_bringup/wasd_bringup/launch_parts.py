# SPDX-License-Identifier: Apache-2.0
"""
What the launch files of the robots share: arguments, and the nodes around a controller.

Everything that a namespace should keep apart is renamed to a relative name: in the namespace
`go2` the robot has a clock and a tree of frames of its own, /go2/clock and /go2/tf; `wasd` with
such a namespace does the same.
"""

from typing import Any

from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import AndSubstitution
from launch.substitutions import EqualsSubstitution
from launch.substitutions import LaunchConfiguration
from launch.substitutions import NotEqualsSubstitution
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare
from mujoco_sim.parameters import SimulatorParameters
from wasd_core.parameters import known_parameters
from wasd_core.parameters import Parameters

from wasd_bringup.options import NAMESPACED
from wasd_bringup.robots import RobotRow
from wasd_bringup.robots import unitree_help
from wasd_bringup.robots import UNITREE_PRESET

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


def robot_arguments(robot: RobotRow) -> list[DeclareLaunchArgument]:
    """Return the arguments that all robots have, with the defaults of one."""
    usual = PathJoinSubstitution([FindPackageShare('wasd_bringup'), 'launch', 'simulated.yaml'])
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
            default_value=usual,
            description="ROS parameters of the robot's nodes; they come before other arguments.",
        ),
        *(parameter_argument(SimulatorParameters, name) for name in ('world', 'seed', 'speed')),
        DeclareLaunchArgument(
            'namespace', default_value='', description='Of all nodes, topics, clock and tf.'
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
    package: str, executable: str, condition: IfCondition | None = None, **parameters: Any
) -> Node:
    """Return a node with parameters, and those of the user's file on top."""
    return Node(
        package=package,
        executable=executable,
        namespace=LaunchConfiguration('namespace'),
        output='screen',
        parameters=[parameters, LaunchConfiguration('params_file')],
        remappings=list(NAMESPACED),
        condition=condition,
    )


def robot_nodes(
    has_physics: IfCondition | None = None, use_sim_time: Any = True, **simulator: Any
) -> list[Node]:
    """
    Return simulator and state publisher; `simulator` are parameters of the first.

    Where there may be no physics, there is no simulator then, and no simulated time.
    """
    robot = ParameterValue(LaunchConfiguration('description'), value_type=str)
    names = ('world', 'seed', 'speed')
    asked = {name: parameter_value(SimulatorParameters, name) for name in names}
    return [
        robot_node(
            'mujoco_sim', 'simulator', has_physics, description=robot, **asked, **simulator
        ),
        robot_node(
            'robot_description', 'state_publisher', description=robot, use_sim_time=use_sim_time
        ),
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
    preset = {'preset': ParameterValue(keys, value_type=str), 'use_sim_time': use_sim_time}
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
