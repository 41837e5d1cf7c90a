# SPDX-License-Identifier: Apache-2.0
"""The state publisher as a program: --help and wrong words are answered before it loads."""

from wasd_core.command_line import Executable
from wasd_core.parameters import fixed, parameter, Parameters


class StatePublisherParameters(Parameters):
    """What the state publisher publishes."""

    description: str = fixed('mbot', doc='Robot: a built-in name, or a xacro or URDF file')
    controller: str = fixed(
        '', doc='YAML file of a drive controller: the springs of the wheels that it names are held'
    )
    publish_frequency: float = parameter(
        50.0,
        minimum=0.1,
        maximum=1000.0,
        doc='Rate of /tf, at most that of joint_states',
        unit='Hz',
    )


state_publisher = Executable(
    name='state_publisher',
    module='robot_description.state_publisher_node',
    node='StatePublisherNode',
    about='Publishes robot_description, and with joint_states the poses of links on /tf.',
    parameters=('robot_description.parameters:StatePublisherParameters',),
    example='state_publisher --ros-args -p description:=mbot -p use_sim_time:=true',
)
