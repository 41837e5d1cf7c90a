# SPDX-License-Identifier: Apache-2.0
"""Reads in a drive controller's file which wheels it drives."""

from typing import Any

from wasd_core.parameter_file import flat, read_mapping

from robot_description.morphology.wheels import ANY_WHEELS, WheelChoice


def read_wheel_choice(path: str) -> WheelChoice:
    """
    Return what a drive controller's file says of the wheels, in any format; '' says nothing.

    The controller reads all of it, and says what is wrong.

    Raises:
        InvalidParameter: it cannot be read, or is no YAML.
    """
    if not path:
        return ANY_WHEELS
    found: dict[str, Any] = read_mapping(
        path, lambda root: {name.rpartition('.')[2]: entry.value for name, entry in flat(root)}
    )
    sides = (found.get(f'{side}_wheel_names') for side in ('left', 'right'))
    names = (name for side in sides if isinstance(side, list) for name in side)
    radius = found.get('wheel_radius')
    return WheelChoice(
        tuple(map(str, names)), float(radius) if isinstance(radius, int | float) else 0.0
    )
