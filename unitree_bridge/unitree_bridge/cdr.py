# SPDX-License-Identifier: Apache-2.0
"""
Messages as bytes: CDR, little endian, with its header of four bytes [OMG DDSI-RTPS 2.5, 10].

A number lies at a multiple of its size, counted from behind the header. Of a message whose size
is always the same a `Layout` knows where each field is, so that NumPy reads and writes it there.
"""

from collections.abc import Iterator, Mapping
import struct
from typing import Any, NamedTuple, TypeGuard

import numpy as np
from wasd_core.errors import InvalidMessage

from unitree_bridge.shapes import FLAG, Kind, Many, Several, Shape, TEXT

HEADER = b'\x00\x01\x00\x00'
# What a stranger's message may ask us to make room for [bytes, elements].
LONGEST = 1 << 22

_FORMATS = {
    **{'u1': 'B', 'u2': 'H', 'u4': 'I', 'u8': 'Q'},
    **{'i1': 'b', 'i2': 'h', 'i4': 'i', 'i8': 'q'},
    **{'f4': 'f', 'f8': 'd'},
}
_NUMBERS = {kind: struct.Struct('<' + letter) for kind, letter in _FORMATS.items()}


def encode(shape: Shape, values: Mapping[str, Any]) -> bytes:
    """Return a message with these values; fields that are not named are zero or empty."""
    out = bytearray(HEADER)
    _write_shape(out, shape, values)
    return bytes(out)


def _write_shape(out: bytearray, shape: Shape, values: Mapping[str, Any]) -> None:
    unknown = values.keys() - shape.fields.keys()
    if unknown:
        raise KeyError(f'{shape.name} has no {sorted(unknown)}')
    for name, kind in shape.fields.items():
        _write(out, kind, values.get(name))


def _write(out: bytearray, kind: Kind, value: Any) -> None:
    if isinstance(kind, Shape):
        _write_shape(out, kind, value or {})
    elif isinstance(kind, Several):
        blank = 0 if _is_number(kind.kind) else None
        _write_all(out, kind.kind, [blank] * kind.number if value is None else value)
    elif isinstance(kind, Many):
        items = () if value is None else value
        _write_number(out, 'u4', len(items))
        _write_all(out, kind.kind, items)
    elif kind == TEXT:
        text = (value or '').encode() + b'\0'
        _write_number(out, 'u4', len(text))
        out += text
    else:
        _write_number(out, 'u1' if kind == FLAG else kind, value or 0)


def _write_all(out: bytearray, kind: Kind, items: Any) -> None:
    if kind == 'u1' and isinstance(items, (bytes, bytearray)):
        out += items
    elif _is_number(kind) and len(items):
        _align(out, _NUMBERS[kind].size)
        out += struct.pack(f'<{len(items)}{_FORMATS[kind]}', *items)
    else:
        for item in items:
            _write(out, kind, item)


def _write_number(out: bytearray, kind: str, value: Any) -> None:
    number = _NUMBERS[kind]
    _align(out, number.size)
    out += number.pack(value)


def _is_number(kind: Kind) -> TypeGuard[str]:
    return isinstance(kind, str) and kind in _NUMBERS


def _align(out: bytearray, size: int) -> None:
    out += bytes(-(len(out) - len(HEADER)) % size)


def decode(shape: Shape, raw: bytes) -> dict[str, Any]:
    """
    Return the values of a message; numbers of eight bits that follow each other are bytes.

    Raises:
        InvalidMessage: it has another encoding, ends early, or says of itself what cannot be.
    """
    check_header(raw)
    try:
        return _Reader(raw).shape(shape)
    except (struct.error, IndexError, UnicodeDecodeError) as error:
        raise InvalidMessage(f'{shape.name}: {error}') from None


def check_header(raw: bytes) -> None:
    """
    Refuse what is no CDR of little endian.

    Raises:
        InvalidMessage: what its header is.
    """
    if raw[:2] != HEADER[:2]:
        raise InvalidMessage(f'encoding: got {raw[:2].hex() or "nothing"}, wanted 0001 (CDR)')


class _Reader:
    """Reads a message from its start."""

    def __init__(self, raw: bytes) -> None:
        self._raw, self._at = raw, len(HEADER)

    def shape(self, shape: Shape) -> dict[str, Any]:
        return {name: self._read(kind) for name, kind in shape.fields.items()}

    def _read(self, kind: Kind) -> Any:
        if isinstance(kind, Shape):
            return self.shape(kind)
        if isinstance(kind, Several):
            return self._items(kind.kind, kind.number)
        if isinstance(kind, Many):
            return self._items(kind.kind, self._length())
        if kind == TEXT:
            text = self._bytes(self._length())
            return text.removesuffix(b'\0').decode()
        return bool(self._number('u1')) if kind == FLAG else self._number(kind)

    def _items(self, kind: Kind, count: int) -> Any:
        if kind == 'u1':
            return self._bytes(count)
        if _is_number(kind) and count:
            size = _NUMBERS[kind].size
            self._at += -(self._at - len(HEADER)) % size
            return list(struct.unpack(f'<{count}{_FORMATS[kind]}', self._bytes(count * size)))
        return [self._read(kind) for _ in range(count)]

    def _length(self) -> int:
        length = self._number('u4')
        if length > min(LONGEST, len(self._raw)):
            raise IndexError(f'a length of {length} in {len(self._raw)} bytes')
        return int(length)

    def _bytes(self, count: int) -> bytes:
        start, self._at = self._at, self._at + count
        if self._at > len(self._raw):
            raise IndexError(f'it ends after {len(self._raw)} bytes')
        return self._raw[start : self._at]

    def _number(self, kind: str) -> Any:
        number = _NUMBERS[kind]
        self._at += -(self._at - len(HEADER)) % number.size
        (value,) = number.unpack(self._bytes(number.size))
        return value


class Place(NamedTuple):
    """Where a number is: in CDR with its header, and in the struct that C makes of the shape."""

    path: str
    kind: str
    at: int
    in_struct: int


class Field(NamedTuple):
    """The numbers of a field in a message: their type, where the first is, how far apart."""

    kind: str
    at: int
    step: int
    length: int

    def of(self, raw: bytes | bytearray) -> np.ndarray:
        """Return them, (length,): a view on the message's memory."""
        return np.ndarray((self.length,), self.kind, raw, self.at, (self.step,))


class Layout:
    """
    Where the numbers of a message are whose size is always the same.

    `size` is that with the header [bytes]. A path names a field and those it is in, as
    `imu_state.rpy` or `motor_cmd.q`; where a shape is there several times, that field of all.
    """

    def __init__(self, shape: Shape) -> None:
        self.shape = shape
        self._end = self._struct_end = 0
        self.places = list(self._lay(shape, ''))
        self.size = len(HEADER) + self._end
        self.struct_size = self._struct_end + -self._struct_end % _alignment(shape)

    def _lay(self, kind: Kind, path: str) -> Iterator[Place]:
        if isinstance(kind, Shape):
            alignment = _alignment(kind)
            self._struct_end += -self._struct_end % alignment
            for name, part in kind.fields.items():
                yield from self._lay(part, f'{path}.{name}' if path else name)
            self._struct_end += -self._struct_end % alignment
        elif isinstance(kind, Several):
            for _ in range(kind.number):
                yield from self._lay(kind.kind, path)
        else:
            assert isinstance(kind, str)
            size = _NUMBERS[kind].size
            self._end += -self._end % size
            self._struct_end += -self._struct_end % size
            yield Place(path, kind, len(HEADER) + self._end, self._struct_end)
            self._end += size
            self._struct_end += size

    def field(self, path: str) -> 'Field':
        """Return where the numbers of a field are, which lie evenly spaced."""
        kind, places = self._kind_and_places(path)
        steps = set(np.diff(places).tolist()) or {_NUMBERS[kind].size}
        if len(steps) > 1:
            raise KeyError(f'{path} of {self.shape.name} is not evenly spaced')
        return Field('<' + kind, places[0], steps.pop(), len(places))

    def places_of(self, path: str) -> np.ndarray:
        """Return where the numbers of a field begin in a message, (n,)."""
        return np.array(self._kind_and_places(path)[1])

    def _kind_and_places(self, path: str) -> tuple[str, list[int]]:
        found = [place for place in self.places if place.path == path]
        if not found:
            raise KeyError(f'{self.shape.name} has no {path}')
        return found[0].kind, [place.at for place in found]

    def struct_bytes(self) -> np.ndarray:
        """Return for each byte of the C struct where it is in a message, (struct_size,)."""
        places = np.zeros(self.struct_size, dtype=int)  # the header's first byte is zero
        for place in self.places:
            size = _NUMBERS[place.kind].size
            places[place.in_struct : place.in_struct + size] = range(place.at, place.at + size)
        return places


def _alignment(kind: Kind) -> int:
    if isinstance(kind, Shape):
        return max(_alignment(part) for part in kind.fields.values())
    if isinstance(kind, Several):
        return _alignment(kind.kind)
    assert isinstance(kind, str)
    return _NUMBERS[kind].size
