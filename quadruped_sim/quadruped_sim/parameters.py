# SPDX-License-Identifier: Apache-2.0
"""
Parameters of the leg controller, on the Go2 and scaled to other robots; its node's; the program.

A number's unit says how it grows with a robot's size and mass [Alexander1983].
"""

from dataclasses import fields, replace
import math
from typing import Any, TYPE_CHECKING, TypeVar

from wasd_core.command_line import Executable
from wasd_core.feed import ENOUGH
from wasd_core.parameters import fixed, group, parameter, Parameters
from wasd_core.robot_io import GRAVITY, LEG_RATE

from quadruped_sim.tuning import (
    BalanceParameters,
    CommandParameters,
    ContactParameters,
    EstimatorParameters,
    FootholdParameters,
    GaitParameters,
    GripParameters,
    GroundParameters,
    JumpParameters,
    MpcParameters,
    ReferenceParameters,
    SafetyParameters,
    WholeBodyParameters,
)

if TYPE_CHECKING:
    from robot_description.morphology.quadruped import Scale

# Costs of squared errors, so that their products stay comparable: units of each element.
WEIGHT_UNITS = {
    'pose_weights': ('1/rad^2',) * 3 + ('1/m^2',) * 3,
    'rate_weights': ('s^2/rad^2',) * 3 + ('s^2/m^2',) * 3,
    'acceleration_weights': ('s^4/m^2',) * 3 + ('s^4/rad^2',) * 3,
    'force_weight': ('1/N^2',),
}
# Shares of the feet's friction: for forces, and for speeding up.
FRICTION_SHARE = 0.8
ACCELERATION_SHARE = 0.4
# Motors of less than this share of the Go2's speed have not the time to lift feet as high: at full
# stick such robots came sideways only 0.83 as fast (catalogue: legs/slow_motors).
LIFT_SHARE = 0.5
NAME = 'leg_controller'
# Parameters of the driver or the wire, not of the body.
NOT_SCALED = {'timeout'}

Group = TypeVar('Group', bound=Parameters)


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


class LegNodeParameters(LegControllerParameters):
    """Which robot, how it is estimated, its rates and frames; and the tuning, in groups."""

    description: str = fixed('go2', doc='Robot: a built-in name, or a xacro or URDF file')
    estimator: str = fixed(
        'kalman',
        choices=('kalman', 'truth'),
        doc='Base state from IMU and legs, or from the simulator',
    )
    controller: str = fixed(
        '', doc='YAML file with parameters: a plain table or a ROS 2 parameter file'
    )
    policy: str = fixed(
        '', doc="Network that walks (2, then p): an ONNX or TorchScript file, or ours; '' is none"
    )
    policy_config: str = fixed(
        '', doc='File or preset with the training settings, if the network has none'
    )
    eyes: bool = parameter(
        False, doc='Walk by sight: footholds and base by the heights that the lidar has seen'
    )
    update_rate: float = fixed(
        LEG_RATE,
        doc='Rate of the controller in lock-step; alone it steps at each state, and moves nothing '
        f'while they come at less than {ENOUGH} of it',
        unit='Hz',
        # At 250 a Go2 at 2 m/s falls with answers three states late, the most that the simulator
        # allows; at 300 it does not.
        minimum=300.0,
        maximum=1000.0,
    )
    publish_rate: float = fixed(
        50.0, minimum=1.0, maximum=500.0, doc='Rate of odom and /tf', unit='Hz'
    )
    odom_frame: str = fixed('odom', doc='Frame in which odometry is given')
    base_frame: str = fixed(
        '', doc="Frame of the robot that odometry follows; '' is its root link"
    )

    @classmethod
    def from_file(cls, path: str) -> 'LegNodeParameters':
        """
        Return the defaults with the values of a YAML file; without a path the defaults.

        Raises:
            InvalidParameter: what is wrong with the file, with its line.
        """
        if not path:
            return cls()
        # Here, because it loads YAML, which most do without.
        from wasd_core.parameter_file import NodeKind, read_parameters

        return cls().changed(read_parameters(path, cls, NodeKind(NAME, 'leg controller')))


def scale_parameters(
    params: LegControllerParameters,
    scale: 'Scale',
    friction: float = math.inf,
    motor_speed: float = 1.0,
) -> LegControllerParameters:
    """
    Return parameters tuned on the Go2 as they are on a robot of this scale.

    On feet with little `friction` forces and accelerations keep inside it. Motors of a share
    `motor_speed` of the Go2's lift the feet lower, so that these are up and down in time.
    """
    result = params
    if scale.length != 1.0 or scale.mass != 1.0:
        names = [field.name for field in fields(LegControllerParameters)]
        groups = {name: _scale_group(getattr(params, name), scale) for name in names}
        result = replace(params, **groups)
    mpc, command, gait = result.mpc, result.command, result.gait
    lift = min(1.0, motor_speed / LIFT_SHARE)
    grip = ACCELERATION_SHARE * friction * GRAVITY
    return replace(
        result,
        gait=replace(
            gait,
            step_height=lift * gait.step_height,
            rough_step_height=lift * gait.rough_step_height,
        ),
        mpc=replace(mpc, friction=min(mpc.friction, FRICTION_SHARE * friction)),
        command=replace(
            command,
            forward_acceleration=min(command.forward_acceleration, grip),
            lateral_acceleration=min(command.lateral_acceleration, grip),
            curve_acceleration=min(command.curve_acceleration, grip),
        ),
    )


def _scale_group(group: Group, scale: 'Scale') -> Group:
    changed: dict[str, Any] = {}
    for field in fields(group):
        value, unit = getattr(group, field.name), field.metadata['unit']
        if field.name in NOT_SCALED:
            continue
        if field.name in WEIGHT_UNITS:
            factors = [scale.of(part) for part in WEIGHT_UNITS[field.name]]
        elif unit:
            factors = [scale.of(unit)] * (len(value) if isinstance(value, tuple) else 1)
        else:
            continue
        if isinstance(value, tuple):
            changed[field.name] = tuple(v * f for v, f in zip(value, factors, strict=True))
        else:
            changed[field.name] = value * factors[0]
    return replace(group, **changed)


leg_controller = Executable(
    name=NAME,
    module='quadruped_sim.leg_controller_node',
    node='LegControllerNode',
    about='Walks a quadruped: keys and cmd_vel in, joint_commands, odom and /tf out.',
    parameters=('quadruped_sim.parameters:LegNodeParameters',),
    example='leg_controller --ros-args -p description:=go2 -p use_sim_time:=true',
)
