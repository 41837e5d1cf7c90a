# SPDX-License-Identifier: Apache-2.0
"""Messages as YAML and back, in ros2cli's form, by what a message says of its fields."""

from array import array
from collections.abc import Callable, Mapping
import re
import sys
from typing import Any

import numpy as np
from wasd_core.errors import suggest
import yaml

from wasd_bringup.errors import UsageError
from wasd_bringup.field_types import parse_field_type

# Longer arrays and texts are cut unless asked for whole, as ros2cli does.
SHOWN_LENGTH = 128

FindType = Callable[[str], type[Any]]


def to_yaml(value: Any, longest: int | None = SHOWN_LENGTH) -> str:
    """Return a message or one of its fields as YAML text, ending with a line break."""
    plain = to_plain(value, longest)
    if not isinstance(plain, (dict, list)):
        return f'{plain}\n'
    return str(
        yaml.dump(
            plain,
            allow_unicode=True,
            default_flow_style=False,
            sort_keys=False,
            width=sys.maxsize,
        )
    )


def to_plain(value: Any, longest: int | None = None) -> Any:
    """Return a message as dictionaries, lists and numbers; what is longer ends in '...'."""
    if hasattr(value, 'get_fields_and_field_types'):
        return {
            name: to_plain(getattr(value, name), longest)
            for name in value.get_fields_and_field_types()
        }
    if isinstance(value, bytes):  # a single `byte`
        value = ''.join(map(chr, value))
    if isinstance(value, str):
        return value if longest is None or len(value) <= longest else f'{value[:longest]}...'
    if isinstance(value, (list, tuple, array, np.ndarray)):
        items = [to_plain(item, longest) for item in list(value)[:longest]]
        return items if longest is None or len(value) <= longest else [*items, '...']
    return value.item() if isinstance(value, np.generic) else value


def field_of(message: Any, path: str) -> Any:
    """
    Return a field by its path, e.g. `pose.pose.position` or `position[0]`.

    Raises:
        UsageError: there is no such field; says which there are.
    """
    found = message
    for part in path.split('.'):
        match = re.fullmatch(r'(\w+)((?:\[-?\d+\])*)', part)
        names = _field_names(found)
        if match is None or match[1] not in names:
            kind = type(found).__name__
            raise UsageError(f'--field {path}: {kind} has no {part!r}{suggest(part, names)}')
        found = getattr(found, match[1])
        for index in re.findall(r'-?\d+', match[2]):
            try:
                found = found[int(index)]
            except (IndexError, TypeError):
                raise UsageError(f'--field {path}: no element {index} of {match[1]}') from None
    return found


def fill(message: Any, values: Any, find_type: FindType, where: str = '') -> None:
    """
    Set the fields of a message that a mapping names; `find_type` finds `package/Name`.

    Raises:
        UsageError: an unknown field, or a value that it cannot have.
    """
    kind = type(message).__name__
    if not isinstance(values, Mapping):
        raise UsageError(f'{where or kind}: wanted fields as {{name: value}}, got {values!r}')
    types = message.get_fields_and_field_types()
    for name, value in values.items():
        if name not in types:
            raise UsageError(f'{kind} has no field {name!r}{suggest(str(name), list(types))}')
        place = f'{where}.{name}' if where else name
        setattr(message, name, _from_plain(value, types[name], find_type, place))


def _field_names(value: Any) -> list[str]:
    fields: dict[str, str] = getattr(value, 'get_fields_and_field_types', dict)()
    return list(fields)


def _from_plain(value: Any, kind: str, find_type: FindType, where: str) -> Any:
    """Return a value as the type of a field wants it."""
    field = parse_field_type(kind)
    if not field.is_single:
        if not isinstance(value, list) or field.length not in (None, len(value)):
            raise UsageError(f'{where}: wanted {kind}, got {value!r}')
        return [
            _from_plain(one, field.item, find_type, f'{where}[{index}]')
            for index, one in enumerate(value)
        ]
    if field.is_message:
        nested = find_type(kind)()
        fill(nested, value, find_type, where)
        return nested
    if field.is_string and isinstance(value, (str, int, float)):
        return str(value)
    return _primitive(value, kind, where)


def _primitive(value: Any, kind: str, where: str) -> Any:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if kind == 'boolean' and isinstance(value, bool):
        return value
    if kind in ('float', 'double') and is_number:
        return float(value)
    if kind.startswith(('int', 'uint')) and is_number and value == int(value):
        return int(value)
    if kind == 'octet' and is_number and 0 <= value <= 255:
        return bytes([int(value)])
    raise UsageError(f'{where}: wanted {kind}, got {value!r}')
