# SPDX-License-Identifier: Apache-2.0
"""
Drives whatever listens to `cmd_vel` from the terminal that `ros2 launch` was called in.

    ros2 launch wasd_bringup teleop.launch.py preset:=wasd scale_linear:=0.3 cmd_vel:=key_vel

Every parameter of `keys_to_twist` is an argument. Neither a window nor xterm is needed: launch
gives a node no terminal on its input, and teleop opens /dev/tty.
"""

import dataclasses

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from teleop_keyboard.parameters import TeleopParameters

TOPICS = ('cmd_vel', 'keys', 'odom', 'state')


def declare_parameter(field):
    """Return the launch argument of a parameter of keys_to_twist."""
    choices = field.metadata['choices']
    return DeclareLaunchArgument(
        field.name,
        default_value=str(field.default),
        description=field.metadata['doc'],
        choices=list(choices) if choices else None,
    )


def generate_launch_description():
    """Return the arguments and the one process, whose end is the end of the launch."""
    fields = dataclasses.fields(TeleopParameters)
    values = {
        # A preset called 1.yaml stays text; numbers and switches become what YAML makes of them.
        field.name: ParameterValue(LaunchConfiguration(field.name), value_type=type(field.default))
        for field in fields
    }
    arguments = [
        DeclareLaunchArgument(
            'stamped', default_value='auto', description='TwistStamped: true, false or auto.'
        ),
        DeclareLaunchArgument(
            'use_sim_time', default_value='false', description='Follow /clock: true or false.'
        ),
        DeclareLaunchArgument('namespace', default_value='', description='Of nodes and topics.'),
        *(
            DeclareLaunchArgument(name, default_value=name, description=f'Topic for {name}.')
            for name in TOPICS
        ),
    ]
    teleop = Node(
        package='teleop_keyboard',
        executable='teleop',
        namespace=LaunchConfiguration('namespace'),
        output='screen',
        parameters=[
            {
                **values,
                'stamped': LaunchConfiguration('stamped'),
                'use_sim_time': LaunchConfiguration('use_sim_time'),
            }
        ],
        remappings=[(name, LaunchConfiguration(name)) for name in TOPICS],
        on_exit=Shutdown(),
    )
    return LaunchDescription([*map(declare_parameter, fields), *arguments, teleop])
