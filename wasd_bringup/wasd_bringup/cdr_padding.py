# SPDX-License-Identifier: Apache-2.0
"""
The bytes between and behind the fields of a serialised message.

CDR aligns numbers to their size. The middleware leaves in the gaps what was in its memory before:
two equal messages are not equal bytes, and a recording would hold scraps of the process.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

from wasd_bringup.field_types import FieldType
from wasd_bringup.field_types import parse_field_type

HEADER = 4
_SIZES = {
    **dict.fromkeys(('boolean', 'octet', 'char', 'int8', 'uint8'), 1),
    **dict.fromkeys(('int16', 'uint16'), 2),
    **dict.fromkeys(('int32', 'uint32', 'float'), 4),
    **dict.fromkeys(('int64', 'uint64', 'double'), 8),
}

FindType = Callable[[str], Any]


class _Step(NamedTuple):
    """Numbers of a `size`, strings (0) or messages, so many; a sequence says itself how many."""

    size: int
    number: int | None
    fields: 'tuple[_Step, ...]' = ()


def clear_padding(data: bytes, kind: Any, find_type: FindType) -> bytes:
    """
    Return a serialised message with zeros between its fields.

    `kind` is its class, `find_type` returns that of `package/Name`. A message with wide strings
    is returned as it is.
    """
    try:
        steps = _steps(kind, find_type)
    except KeyError:
        return data
    cleared = bytearray(data[HEADER:])
    end = _clear(cleared, 0, steps)
    # The middleware also reserves more than it needs behind empty sequences.
    return data[:HEADER] + bytes(cleared[:end])


@cache
def _steps(kind: Any, find_type: FindType) -> tuple[_Step, ...]:
    types = kind.get_fields_and_field_types().values()
    return tuple(_step(parse_field_type(text), find_type) for text in types)


def _step(kind: FieldType, find_type: FindType) -> _Step:
    count = None if kind.is_sequence else kind.length or 1
    if kind.is_message:
        return _Step(0, count, _steps(find_type(kind.item), find_type))
    if kind.item.startswith('string'):
        return _Step(0, count)
    return _Step(_SIZES[kind.item], count)


def _clear(data: bytearray, at: int, steps: tuple[_Step, ...]) -> int:
    """Clear the gaps before and between fields that begin at a place; return where they end."""
    for size, count, fields in steps:
        if count is None:
            at = _align(data, at, 4)
            count = int.from_bytes(data[at : at + 4], 'little')
            at += 4
        if size and count:
            at = _align(data, at, size) + size * count
        elif fields:
            for _ in range(count):
                at = _clear(data, at, fields)
        elif not size:
            for _ in range(count):
                at = _align(data, at, 4)
                at += 4 + int.from_bytes(data[at : at + 4], 'little')
    return at


def _align(data: bytearray, at: int, size: int) -> int:
    gap = -at % size
    if gap:
        data[at : at + gap] = bytes(gap)
    return at + gap
