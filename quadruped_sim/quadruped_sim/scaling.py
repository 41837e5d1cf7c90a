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
from typing import Any, TypeVar

from robot_description.parameters import Parameters
from robot_description.similarity import Scale

from quadruped_sim.parameters import LegControllerParameters

# Costs of squared errors, so that their products stay comparable: units of each element.
WEIGHT_UNITS = {
    'pose_weights': ('1/rad^2',) * 3 + ('1/m^2',) * 3,
    'rate_weights': ('s^2/rad^2',) * 3 + ('s^2/m^2',) * 3,
    'acceleration_weights': ('s^4/m^2',) * 3 + ('s^4/rad^2',) * 3,
    'force_weight': ('1/N^2',),
}
# What belongs to the one who drives or to the wire, not to the body.
NOT_SCALED = {'timeout'}

Group = TypeVar('Group', bound=Parameters)


def scaled(params: LegControllerParameters, scale: Scale) -> LegControllerParameters:
    """Return parameters tuned on the Go2 as they are on a robot of this scale."""
    groups = {field.name: _scaled(getattr(params, field.name), scale) for field in fields(params)}
    return replace(params, **groups)


def _scaled(group: Group, scale: Scale) -> Group:
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
