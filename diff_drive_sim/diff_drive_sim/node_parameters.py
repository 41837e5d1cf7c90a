# SPDX-License-Identifier: Apache-2.0
"""The parameters of the controller's node: from a file, from ROS, by other projects' names."""

import dataclasses
import difflib
from typing import NamedTuple

from rclpy.node import Node
from rclpy.parameter import Parameter
from wasd_core.parameters import outward_name

from diff_drive_sim.controller_file import ALIASES
from diff_drive_sim.controller_file import read_controller_file
from diff_drive_sim.controller_file import translate
from diff_drive_sim.controller_file import UNUSED
from diff_drive_sim.parameters import DiffDriveParameters


class GivenParameters(NamedTuple):
    """Defaults with a file's values in them, and the controller's name."""

    defaults: DiffDriveParameters
    name: str


def read_given(node: Node) -> GivenParameters:
    """
    Read the file that the parameter `controller` names; give overrides their names here.

    What ROS was given comes before the file. What means nothing here is said once.

    Raises:
        InvalidParameter: what is wrong with the file, with its line.
    """
    overrides = node._parameter_overrides
    if 'mode' in overrides and overrides['mode'].value == '':
        del overrides['mode']  # how a launch file says nothing
    unused = {name for name in overrides if name in UNUSED - {'use_sim_time', 'type'}}
    for name, given in list(overrides.items()):
        outward, value = translate(name, given.value)
        if (outward, value) != (name, given.value):
            overrides[outward] = Parameter(outward, value=value)
        elif not _is_known(node, name):
            near = difflib.get_close_matches(name, [*_known_names(), *ALIASES], n=1)
            hint = f', did you mean {near[0]!r}?' if near else ''
            node.get_logger().warning(f'unknown parameter {name!r}{hint}: ignored')
    path = overrides['controller'].value if 'controller' in overrides else ''
    if not isinstance(path, str) or not path:
        _say_unused(node, unused)
        return GivenParameters(DiffDriveParameters(), '')
    file = read_controller_file(path)
    _say_unused(node, unused | set(file.unused))
    return GivenParameters(DiffDriveParameters.from_mapping(file.values), file.name)


def _known_names() -> set[str]:
    return {outward_name(field) for field in dataclasses.fields(DiffDriveParameters)}


def _is_known(node: Node, name: str) -> bool:
    declared = name in _known_names() or node.has_parameter(name)
    return declared or name in UNUSED or name.startswith('qos_overrides.')


def _say_unused(node: Node, names: set[str]) -> None:
    if names:
        node.get_logger().info(f'parameters without a meaning here: {", ".join(sorted(names))}')
