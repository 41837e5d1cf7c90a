# SPDX-License-Identifier: Apache-2.0
"""Parameters from a YAML file: arbotix's, ros2_controllers', or a plain table."""

from typing import Any, NamedTuple

from wasd_core.parameter_file import (
    checked,
    children,
    entries_of,
    Entry,
    flat,
    line_of,
    NodeKind,
    read_mapping,
)
from wasd_core.parameters import InvalidParameter
import yaml

from diff_drive_sim.parameters import DiffDriveParameters

# Other projects' names of the same things.
ALIASES = {
    'base_width': 'wheel_separation',
    'timeout': 'cmd_vel_timeout',
    'use_stamped_vel': 'stamped',
    'linear.x.min_acceleration': 'linear.x.max_deceleration',
    'angular.z.min_acceleration': 'angular.z.max_deceleration',
}
# Known, and without a meaning here: a serial port's, a real-time publisher's, ROS's own.
UNUSED = frozenset(
    ('port', 'baud', 'sync_read', 'sync_write', 'read_rate', 'write_rate', 'use_sim_time')
    + ('position_feedback', 'wheels_per_side', 'tf_frame_prefix', 'tf_frame_prefix_enable')
    + ('type',)
)
# What ROS 1 names beside the parameters, and ROS 2 among those of its controller manager.
CONTROLLER_TYPE = 'diff_drive_controller/DiffDriveController'
# What arbotix does when its file leaves a parameter out and ours differs.
ARBOTIX_DEFAULTS = {'cmd_vel_timeout': 1.0}
NODE_NAME = 'diff_drive_controller'
KIND = NodeKind(
    NODE_NAME,
    'diff drive',
    ('left_wheel_names', 'wheel_separation', 'base_width', 'cmd_vel_timeout'),
)


class ControllerFile(NamedTuple):
    """
    A file's content: its `values`, and `parameters` with these in place of defaults.

    `name` is the controller's, `unused` what has no meaning here.
    """

    values: dict[str, Any]
    parameters: DiffDriveParameters
    name: str
    unused: tuple[str, ...]


def read_controller_file(path: str) -> ControllerFile:
    """
    Read and check a file.

    Raises:
        InvalidParameter: `file:line: key, what came, what is wanted`.
    """
    result: ControllerFile = read_mapping(path, _read)
    return result


def _read(root: yaml.MappingNode) -> ControllerFile:
    top = children(root)
    is_arbotix = 'controllers' in top
    if is_arbotix:
        name, entries = _arbotix(root, top)
    else:
        name, entries = entries_of(root, KIND)
    written = dict(flat(root))
    for key, entry in entries.items():
        above, _, last = key.rpartition('.')
        # In the file by the very same name: nothing there is in `ros__parameters`.
        if above and last == 'type' and entry.value == CONTROLLER_TYPE and key in written:
            owner = above.rpartition('.')[2]
            raise InvalidParameter(
                f':{entry.line}: {owner} is of ROS 1, or lacks ros__parameters: wanted '
                f'{owner}: {{ros__parameters: {{left_wheel_names: [JOINT], ...}}}}'
            )
    entries = _without_switched_off(entries)
    values: dict[str, Any] = {}
    unused: list[str] = []
    for key, entry in entries.items():
        if key in UNUSED:
            unused += [] if key == 'type' else [key]
            continue
        outward, value = translate(key, entry.value)
        if outward in values:
            raise InvalidParameter(f':{entry.line}: {key!r} is there twice, as {outward!r}')
        values[outward] = checked(DiffDriveParameters, outward, value, key, entry.line, ALIASES)
    if is_arbotix:
        values = {**ARBOTIX_DEFAULTS, **values}
    parameters = DiffDriveParameters.from_mapping(values)
    return ControllerFile(values, parameters, name, tuple(unused))


def translate(key: str, value: Any) -> tuple[str, Any]:
    """Return a parameter by its name here: `base_width` is `wheel_separation`, `sim` a mode."""
    if key == 'sim' and isinstance(value, bool):
        return 'mode', 'fake' if value else 'float'
    return ALIASES.get(key, key), value


def _arbotix(root: yaml.MappingNode, top: dict[str, yaml.Node]) -> tuple[str, dict[str, Entry]]:
    """Return the diff_controller of a file of arbotix_driver, and the driver's own settings."""
    listed = top['controllers']
    if not isinstance(listed, yaml.MappingNode):
        raise InvalidParameter(
            f':{line_of(listed)}: controllers must name at least one controller'
        )
    kinds = {}
    for name, node in children(listed).items():
        settings = dict(flat(node)) if isinstance(node, yaml.MappingNode) else {}
        kinds[name] = (settings, settings.get('type', Entry(None, line_of(node))))
    chosen = [name for name, (_, kind) in kinds.items() if kind.value == 'diff_controller']
    if len(chosen) != 1:
        found = ', '.join(f'{name} ({kind.value})' for name, (_, kind) in kinds.items())
        raise InvalidParameter(
            f':{line_of(listed)}: controllers needs one of type diff_controller, '
            f'got {found or "none"}'
        )
    driver = {
        key: entry
        for key, entry in flat(root)
        if not key.startswith(('controllers.', 'joints.', 'dynamixels.'))
        # These are the serial line's and the loop's of the driver, not the controller's.
        and key not in ('rate', 'timeout')
    }
    return chosen[0], {**driver, **kinds[chosen[0]][0]}


def _without_switched_off(entries: dict[str, Entry]) -> dict[str, Entry]:
    """Drop the switches has_*_limits of older files, and the limits that they switch off."""
    off = [
        (key.rpartition('.')[0], key.rpartition('.')[2][4:].split('_')[0])
        for key, entry in entries.items()
        if '.has_' in key and entry.value is False
    ]
    kept = {key: entry for key, entry in entries.items() if '.has_' not in key}
    for axis, kind in off:
        names = ('acceleration', 'deceleration') if kind == 'acceleration' else (kind,)
        for key in kept:
            if key.startswith(f'{axis}.') and any(name in key for name in names):
                kept[key] = Entry(float('nan'), kept[key].line)
    return kept
