# SPDX-License-Identifier: Apache-2.0
"""Parameters from a YAML file: arbotix's, ros2_controllers', or a plain table."""

from collections.abc import Iterator
import contextlib
from dataclasses import fields
import difflib
from pathlib import Path
from typing import Any, NamedTuple

from wasd_core.parameters import InvalidParameter
from wasd_core.parameters import outward_name
from wasd_core.safe_yaml import compose_yaml
from wasd_core.safe_yaml import construct
from wasd_core.safe_yaml import read_text
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
# What arbotix does when its file leaves a parameter out and ours differs.
ARBOTIX_DEFAULTS = {'cmd_vel_timeout': 1.0}
NODE_NAME = 'diff_drive_controller'
KNOWN = frozenset(outward_name(field) for field in fields(DiffDriveParameters))


class Entry(NamedTuple):
    """A value of the file and the line it is in."""

    value: Any
    line: int


class ControllerFile(NamedTuple):
    """What a file says: parameters by their names here, the controller's name, what is unused."""

    values: dict[str, Any]
    name: str
    unused: tuple[str, ...]


def read_controller_file(path: str) -> ControllerFile:
    """
    Read and check a file.

    Raises:
        InvalidParameter: `file:line: key, what came, what is wanted`.
    """
    try:
        # YAML forbids tabs to indent; people use them, and what they mean is plain.
        text = read_text(Path(path), 'utf-8-sig').expandtabs(8)
    except UnicodeDecodeError:
        raise InvalidParameter(f'{path}: not a text file') from None
    except OSError as error:
        raise InvalidParameter(f'{path}: {error.strerror}') from None
    try:
        root = compose_yaml(text)
    except yaml.YAMLError as error:
        raise InvalidParameter(f'{path}{_where(error)}') from None
    if not isinstance(root, yaml.MappingNode):
        raise InvalidParameter(f'{path}: wanted "name: value" pairs')
    try:
        return _read(root)
    except InvalidParameter as error:
        raise InvalidParameter(f'{path}{error}') from None


def _where(error: yaml.YAMLError) -> str:
    mark = getattr(error, 'problem_mark', None)
    problem = getattr(error, 'problem', None) or ' '.join(str(error).split())
    hint = ' (is a space missing after a colon?)' if 'mapping values' in problem else ''
    return f':{mark.line + 1}: {problem}{hint}' if mark else f': {problem}'


def _read(root: yaml.MappingNode) -> ControllerFile:
    top = _children(root)
    is_arbotix = 'controllers' in top
    if is_arbotix:
        name, entries = _arbotix(root, top)
    elif any(key == 'ros__parameters' for key in _all_keys(root)):
        name, entries = _ros(root)
    else:
        name, entries = '', dict(_flat(root))
    entries = _without_switched_off(entries)
    values: dict[str, Any] = {}
    unused: list[str] = []
    for key, entry in entries.items():
        if key in UNUSED:
            unused += [] if key == 'type' else [key]
            continue
        outward, value = translate(key, entry.value)
        values[outward] = _checked(outward, value, key, entry.line)
    if is_arbotix:
        values = {**ARBOTIX_DEFAULTS, **values}
    try:
        DiffDriveParameters.from_mapping(values)
    except InvalidParameter as error:  # of what does not go together
        raise InvalidParameter(f': {error}') from None
    return ControllerFile(values, name, tuple(unused))


def translate(key: str, value: Any) -> tuple[str, Any]:
    """Return a parameter by its name here: `base_width` is `wheel_separation`, `sim` a mode."""
    if key == 'sim' and isinstance(value, bool):
        return 'mode', 'fake' if value else 'float'
    key = ALIASES.get(key, key)
    if key == 'stamped' and isinstance(value, bool):
        value = str(value).lower()
    return key, value


def _checked(outward: str, value: Any, key: str, line: int) -> Any:
    """Return a value as it is kept; an unknown name or an illegal value is an error."""
    if outward not in KNOWN:
        if ':' in key:
            raise InvalidParameter(f':{line}: {key!r}: a space is missing after the colon')
        near = difflib.get_close_matches(key, [*KNOWN, *ALIASES], n=1)
        hint = f', did you mean {near[0]!r}?' if near else ''
        raise InvalidParameter(f':{line}: unknown parameter {key!r}{hint}')
    try:
        return DiffDriveParameters.checked(outward, value)
    except InvalidParameter as error:
        # By the name that the user wrote.
        raise InvalidParameter(f':{line}: {str(error).replace(outward, key, 1)}') from None


def _arbotix(root: yaml.MappingNode, top: dict[str, yaml.Node]) -> tuple[str, dict[str, Entry]]:
    """Return the diff_controller of a file of arbotix_driver, and the driver's own settings."""
    listed = top['controllers']
    if not isinstance(listed, yaml.MappingNode):
        raise InvalidParameter(f':{_line(listed)}: controllers must name at least one controller')
    kinds = {}
    for name, node in _children(listed).items():
        settings = dict(_flat(node)) if isinstance(node, yaml.MappingNode) else {}
        kinds[name] = (settings, settings.get('type', Entry(None, _line(node))))
    chosen = [name for name, (_, kind) in kinds.items() if kind.value == 'diff_controller']
    if len(chosen) != 1:
        found = ', '.join(f'{name} ({kind.value})' for name, (_, kind) in kinds.items())
        raise InvalidParameter(
            f':{_line(listed)}: controllers needs one of type diff_controller, '
            f'got {found or "none"}'
        )
    driver = {
        key: entry
        for key, entry in _flat(root)
        if not key.startswith(('controllers.', 'joints.', 'dynamixels.'))
        # These are the serial line's and the loop's of the driver, not the controller's.
        and key not in ('rate', 'timeout')
    }
    return chosen[0], {**driver, **kinds[chosen[0]][0]}


def _ros(root: yaml.MappingNode) -> tuple[str, dict[str, Entry]]:
    """Return the parameters of the one node of a ROS 2 parameter file that is a diff drive."""
    nodes = {name: dict(_flat(node)) for name, node in _parameter_nodes(root)}
    everybody = {
        key: entry for name in ('/**', '**') for key, entry in nodes.pop(name, {}).items()
    }
    marks = ('left_wheel_names', 'wheel_separation', 'base_width', 'cmd_vel_timeout')
    chosen = [name for name in nodes if name.rpartition('/')[2] == NODE_NAME] or [
        name for name, entries in nodes.items() if any(mark in entries for mark in marks)
    ]
    if not chosen and everybody:
        return '', everybody
    if len(chosen) != 1:
        found = ', '.join(chosen or nodes) or 'none'
        raise InvalidParameter(
            f': wanted the parameters of one diff drive, e.g. {NODE_NAME}, got {found}'
        )
    return chosen[0].rpartition('/')[2], {**everybody, **nodes[chosen[0]]}


def _parameter_nodes(
    node: yaml.MappingNode, prefix: str = ''
) -> Iterator[tuple[str, yaml.MappingNode]]:
    for key, child in _children(node).items():
        if not isinstance(child, yaml.MappingNode):
            continue
        if key == 'ros__parameters':
            yield prefix, child
        else:
            yield from _parameter_nodes(child, f'{prefix}/{key}' if prefix else key)


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


def _children(node: yaml.MappingNode) -> dict[str, yaml.Node]:
    found: dict[str, yaml.Node] = {}
    for key, value in node.value:
        name = str(key.value)
        if name in found:
            raise InvalidParameter(f':{_line(key)}: {name!r} is there twice')
        found[name] = value
    return found


def _all_keys(node: yaml.Node) -> Iterator[str]:
    if isinstance(node, yaml.MappingNode):
        for key, child in _children(node).items():
            yield key
            yield from _all_keys(child)


def _flat(node: yaml.MappingNode, prefix: str = '') -> Iterator[tuple[str, Entry]]:
    """Yield scalars and lists by dotted names."""
    for key, child in _children(node).items():
        if isinstance(child, yaml.MappingNode):
            yield from _flat(child, f'{prefix}{key}.')
        else:
            yield f'{prefix}{key}', Entry(_value(child), _line(child))


def _value(node: yaml.Node) -> Any:
    try:
        value = construct(node)
    except yaml.YAMLError as error:
        raise InvalidParameter(_where(error)) from None
    if isinstance(value, str) and isinstance(node, yaml.ScalarNode) and not node.style:
        with contextlib.suppress(ValueError):
            return float(value)  # 1e-3 is a number to ROS and to people, not to YAML 1.1
    return value


def _line(node: yaml.Node) -> int:
    return int(node.start_mark.line) + 1
