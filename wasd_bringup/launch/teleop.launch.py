# SPDX-License-Identifier: Apache-2.0
"""
Drives whatever listens to `cmd_vel` from the terminal that `ros2 launch` was called in.

    ros2 launch wasd_bringup teleop.launch.py preset:=wasd scale_linear:=0.3 cmd_vel:=key_vel

Every parameter of `keys_to_twist` is an argument. Neither a window nor xterm is needed: launch
gives a node no terminal on its input, and teleop opens /dev/tty.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from teleop_keyboard.parameters import TeleopParameters
from wasd_bringup.ros.launch_parts import parameter_argument, parameter_value
from wasd_core.parameters import known_parameters

TOPICS = ('cmd_vel', 'keys', 'odom', 'state')


def generate_launch_description():
    """Return the arguments and the one process, whose end is the end of the launch."""
    names = known_parameters(TeleopParameters)
    arguments = [
        *(parameter_argument(TeleopParameters, name) for name in names),
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
                **{name: parameter_value(TeleopParameters, name) for name in names},
                'use_sim_time': LaunchConfiguration('use_sim_time'),
            }
        ],
        remappings=[(name, LaunchConfiguration(name)) for name in TOPICS],
        on_exit=Shutdown(),
    )
    return LaunchDescription([*arguments, teleop])
