# SPDX-License-Identifier: Apache-2.0
"""A YAML file with the leg controller's parameters."""

from wasd_core.parameter_file import NodeKind, read_parameters

from quadruped_sim.parameters import leg_controller, LegNodeParameters

KIND = NodeKind(leg_controller.name, 'leg controller')


def read_leg_file(path: str) -> LegNodeParameters:
    """
    Return the defaults with the values of a file; without a path the defaults.

    Raises:
        InvalidParameter: what is wrong with the file, with its line.
    """
    if not path:
        return LegNodeParameters()
    return LegNodeParameters.from_mapping(read_parameters(path, LegNodeParameters, KIND))
