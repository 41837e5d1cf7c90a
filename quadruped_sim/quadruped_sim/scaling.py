# SPDX-License-Identifier: Apache-2.0
"""
The Go2's tuning on another robot, by dynamic similarity.

Two robots of one shape that differ in size and mass move alike under the same gravity when every
quantity is scaled by its dimension: lengths by the legs' length, forces by the mass, times by the
square root of length (equal Froude numbers v^2 / (g l), [Alexander1983]). Gains, weights and
thresholds are numbers with units too, so one rule serves them all, and nothing is typed in per
robot: a parameter's unit says how it grows.
"""

from dataclasses import fields
from dataclasses import replace
import math
from typing import Any, TypeVar

from robot_description.morphology.quadruped import Scale
from wasd_core.parameters import Parameters
from wasd_core.robot_io import GRAVITY

from quadruped_sim.parameters import LegControllerParameters

# Costs of squared errors, so that their products stay comparable: units of each element.
WEIGHT_UNITS = {
    'pose_weights': ('1/rad^2',) * 3 + ('1/m^2',) * 3,
    'rate_weights': ('s^2/rad^2',) * 3 + ('s^2/m^2',) * 3,
    'acceleration_weights': ('s^4/m^2',) * 3 + ('s^4/rad^2',) * 3,
    'force_weight': ('1/N^2',),
}
# Of the friction that the feet have: what forces may use, and what speeding up may.
FRICTION_SHARE = 0.8
ACCELERATION_SHARE = 0.4
# Motors of less than this share of the Go2's speed have not the time to lift feet as high: at full
# stick such robots came sideways only 0.83 as fast (catalogue: legs/slow_motors).
LIFT_SHARE = 0.5
# What belongs to the one who drives or to the wire, not to the body.
NOT_SCALED = {'timeout'}

GROUPS = fields(LegControllerParameters)

Group = TypeVar('Group', bound=Parameters)


def scale_parameters(
    params: LegControllerParameters,
    scale: Scale,
    friction: float = math.inf,
    motor_speed: float = 1.0,
) -> LegControllerParameters:
    """
    Return parameters tuned on the Go2 as they are on a robot of this scale.

    On feet with little `friction` forces and accelerations keep inside it. Motors of a share
    `motor_speed` of the Go2's lift the feet lower, so that these are up and down in time.
    """
    groups = {field.name: _scale_group(getattr(params, field.name), scale) for field in GROUPS}
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


def _scale_group(group: Group, scale: Scale) -> Group:
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
