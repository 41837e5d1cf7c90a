# SPDX-License-Identifier: Apache-2.0
"""Parameters of the state publisher."""

from dataclasses import dataclass

from wasd_core.parameters import parameter
from wasd_core.parameters import Parameters


@dataclass(frozen=True, kw_only=True)
class StatePublisherParameters(Parameters):
    """What the state publisher publishes."""

    description: str = parameter(
        'mbot', doc='Robot: a built-in name, or a xacro or URDF file', read_only=True
    )
    publish_frequency: float = parameter(
        50.0, doc='Rate of /tf, at most that of joint_states', unit='Hz', above=0.0
    )
