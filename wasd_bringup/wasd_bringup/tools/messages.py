# SPDX-License-Identifier: Apache-2.0
"""Messages as YAML and back, by their field types."""

from array import array
from collections.abc import Callable, Mapping
import math
import re
import sys
from typing import Any, NamedTuple

import numpy as np
from rosidl_parser.definition import (
    AbstractGenericString,
    AbstractNestedType,
    AbstractSequence,
    Array,
    BasicType,
    NamespacedType,
)
from wasd_core.errors import suggest, UserError
import yaml

# Longer arrays and texts are cut unless asked for whole, as ros2cli does.
SHOWN_LENGTH = 128

FindType = Callable[[str], Any]


def type_name(kind: type[Any]) -> str:
    """Return `package/msg/Name` of a message class."""
    package, interface, *_ = kind.__module__.split('.')
    return f'{package}/{interface}/{kind.__name__}'


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
        UserError: there is no such field; says which there are.
    """
    found = message
    for part in path.split('.'):
        match = re.fullmatch(r'(\w+)((?:\[-?\d+\])*)', part)
        names = list(getattr(found, 'get_fields_and_field_types', dict)())
        if match is None or match[1] not in names:
            kind = type(found).__name__
            raise UserError(f'--field {path}: {kind} has no {part!r}{suggest(part, names)}')
        found = getattr(found, match[1])
        for index in re.findall(r'-?\d+', match[2]):
            try:
                found = found[int(index)]
            except (IndexError, TypeError):
                raise UserError(f'--field {path}: no element {index} of {match[1]}') from None
    return found


def fill(message: Any, values: Any, find_type: FindType, where: str = '') -> None:
    """
    Set the fields of a message that a mapping names; `find_type` finds `package/Name`.

    Raises:
        UserError: an unknown field, or a value that it cannot have.
    """
    kind = type(message).__name__
    if not isinstance(values, Mapping):
        raise UserError(f'{where or kind}: wanted fields as {{name: value}}, got {values!r}')
    words = message.get_fields_and_field_types()
    types = dict(zip(words, message.SLOT_TYPES, strict=True))
    for name, value in values.items():
        if name not in types:
            raise UserError(f'{kind} has no field {name!r}{suggest(str(name), list(types))}')
        place = f'{where}.{name}' if where else name
        setattr(message, name, _from_plain(value, types[name], words[name], find_type, place))


def _from_plain(value: Any, kind: Any, words: str, find_type: FindType, where: str) -> Any:
    """Return a value as the type of a field wants it, which `words` name."""
    if isinstance(kind, AbstractNestedType):
        is_short = isinstance(kind, Array) and isinstance(value, list) and len(value) != kind.size
        if not isinstance(value, list) or is_short:
            raise UserError(f'{where}: wanted {words}, got {value!r}')
        item = kind.value_type
        words = getattr(item, 'typename', 'string')
        return [
            _from_plain(one, item, words, find_type, f'{where}[{index}]')
            for index, one in enumerate(value)
        ]
    if isinstance(kind, NamespacedType):
        nested = find_type('/'.join(kind.namespaced_name()))()
        fill(nested, value, find_type, where)
        return nested
    if isinstance(kind, AbstractGenericString) and isinstance(value, (str, int, float)):
        text = str(value)
        if text != text.encode(errors='replace').decode():  # half of a UTF-16 pair
            raise UserError(f'{where}: wanted text of whole characters, got {value!r}')
        return text
    return _primitive(value, words, where)


# A number to people and to ROS's files, and a text to YAML 1.1, which wants a point and a sign.
_EXPONENT = re.compile(r'[-+]?\d+(\.\d*)?[eE][-+]?\d+')


def _primitive(value: Any, kind: str, where: str) -> Any:
    if isinstance(value, str) and _EXPONENT.fullmatch(value):
        value = float(value)
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if kind == 'boolean' and isinstance(value, bool):
        return value
    if kind in ('float', 'double') and is_number:
        return float(value)
    is_whole = is_number and math.isfinite(value) and value == int(value)
    if kind.startswith(('int', 'uint')) and is_whole:
        bits = 8 * _SIZES[kind]
        low = 0 if kind.startswith('u') else -(1 << bits - 1)
        if not low <= value < low + (1 << bits):
            raise UserError(
                f'{where}: wanted {kind}, {low} to {low + (1 << bits) - 1}, got {value!r}'
            )
        return int(value)
    if kind == 'octet' and is_whole and 0 <= value <= 255:
        return bytes([int(value)])
    raise UserError(f'{where}: wanted {kind}, got {value!r}')


_SIZES = {
    **dict.fromkeys(('boolean', 'octet', 'char', 'int8', 'uint8'), 1),
    **dict.fromkeys(('int16', 'uint16'), 2),
    **dict.fromkeys(('int32', 'uint32', 'float'), 4),
    **dict.fromkeys(('int64', 'uint64', 'double'), 8),
}


class _Field(NamedTuple):
    """A field of a message: whether it is one item or several, counted or not, and of what."""

    name: str
    is_single: bool
    is_counted: bool
    item: Any
    size: int  # of an item [B], 0 unless it is a number


class _Layout(NamedTuple):
    """The fields of a type, and the lengths of such messages [B] where all have the same."""

    fields: tuple[_Field, ...]
    lengths: dict[int, int]  # by their place in 8 bytes


_layouts: dict[Any, _Layout] = {}  # by type


def _layout_of(message: Any) -> _Layout:
    kind = type(message)
    if kind not in _layouts:
        fields = []
        for name, slot in zip(kind.get_fields_and_field_types(), kind.SLOT_TYPES, strict=True):
            is_single = not isinstance(slot, AbstractNestedType)
            item = slot if is_single else slot.value_type
            size = _SIZES[item.typename] if isinstance(item, BasicType) else 0
            fields.append(_Field(name, is_single, isinstance(slot, AbstractSequence), item, size))
        _layouts[kind] = _Layout(tuple(fields), {})
    return _layouts[kind]


def cdr_end(message: Any, start: int = 0) -> int:
    """Return where a message without wide strings ends as CDR, that begins at a place [B]."""
    fields, lengths = _layout_of(message)
    if (known := lengths.get(start % 8)) is not None:
        return start + known
    at, is_fixed = start, True
    for name, is_single, is_counted, item, size in fields:
        value = getattr(message, name)
        items = [value] if is_single else value
        if is_counted:
            at, is_fixed = at + -at % 4 + 4, False
        if size and len(items):
            at += -at % size + size * len(items)
        elif isinstance(item, NamespacedType):
            for each in items:
                at = cdr_end(each, at)
                is_fixed = is_fixed and bool(_layout_of(each).lengths)
        elif isinstance(item, AbstractGenericString):
            is_fixed = False
            for each in items:
                at += -at % 4 + 4 + len(each.encode()) + 1
    if is_fixed:
        lengths[start % 8] = at - start
    return at
