# SPDX-License-Identifier: Apache-2.0
"""Parameters of the leg controller and of its node, and it as a program."""

from dataclasses import dataclass

from wasd_core.command_line import Executable
from wasd_core.parameters import group
from wasd_core.parameters import parameter
from wasd_core.parameters import Parameters

from quadruped_sim.tuning import BalanceParameters
from quadruped_sim.tuning import CommandParameters
from quadruped_sim.tuning import ContactParameters
from quadruped_sim.tuning import EstimatorParameters
from quadruped_sim.tuning import FootholdParameters
from quadruped_sim.tuning import GaitParameters
from quadruped_sim.tuning import GripParameters
from quadruped_sim.tuning import GroundParameters
from quadruped_sim.tuning import JumpParameters
from quadruped_sim.tuning import MpcParameters
from quadruped_sim.tuning import ReferenceParameters
from quadruped_sim.tuning import SafetyParameters
from quadruped_sim.tuning import WholeBodyParameters


@dataclass(frozen=True, kw_only=True)
class LegControllerParameters(Parameters):
    """All parameter groups of the leg controller; `kalman` is the filter's."""

    gait: GaitParameters = group(GaitParameters)
    foothold: FootholdParameters = group(FootholdParameters)
    mpc: MpcParameters = group(MpcParameters)
    whole_body: WholeBodyParameters = group(WholeBodyParameters)
    balance: BalanceParameters = group(BalanceParameters)
    reference: ReferenceParameters = group(ReferenceParameters)
    ground: GroundParameters = group(GroundParameters)
    contact: ContactParameters = group(ContactParameters)
    grip: GripParameters = group(GripParameters)
    kalman: EstimatorParameters = group(EstimatorParameters)
    command: CommandParameters = group(CommandParameters)
    jump: JumpParameters = group(JumpParameters)
    safety: SafetyParameters = group(SafetyParameters)


@dataclass(frozen=True, kw_only=True)
class LegNodeParameters(LegControllerParameters):
    """Which robot, how it is estimated, its rates and frames; and the tuning, in groups."""

    description: str = parameter(
        'go2', doc='Robot: a built-in name, or a xacro or URDF file', read_only=True
    )
    estimator: str = parameter(
        'kalman',
        choices=('kalman', 'truth'),
        doc='Base state from IMU and legs, or from the simulator',
        read_only=True,
    )
    controller: str = parameter(
        '',
        doc='YAML file with parameters: a plain table or a ROS 2 parameter file',
        read_only=True,
    )
    update_rate: float = parameter(
        500.0, doc='Rate of the controller', unit='Hz', above=0.0, read_only=True
    )
    publish_rate: float = parameter(
        50.0, doc='Rate of odom and /tf', unit='Hz', above=0.0, read_only=True
    )
    odom_frame: str = parameter('odom', doc='Frame in which odometry is given', read_only=True)
    base_frame: str = parameter(
        '', doc="Frame of the robot that odometry follows; '' is its root link", read_only=True
    )


leg_controller = Executable(
    name='leg_controller',
    module='quadruped_sim.leg_controller_node',
    about='Walks a quadruped: keys and cmd_vel in, joint_commands, odom and /tf out.',
    parameters=('quadruped_sim.parameters:LegNodeParameters',),
    example='leg_controller --ros-args -p description:=go2 -p use_sim_time:=true',
)
