# SPDX-License-Identifier: Apache-2.0
"""
Reads an ONNX file's facts from its bytes, before any library opens it.

The format is protobuf [https://protobuf.dev/programming-guides/encoding]; field numbers are those
of onnx.proto3.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from policy_player.spec import PolicyError

# A policy has some 1e5 to 1e7 parameters [bytes].
LARGEST_NETWORK = 100_000_000
# Graphs within graphs, and all messages looked at.
DEEPEST, MOST_MESSAGES = 20, 300_000


@dataclass
class OnnxFile:
    """A file's bytes, its metadata, and the files beside it that have weights."""

    path: Path
    data: bytes
    metadata: dict[str, str] = field(default_factory=dict)
    external: set[str] = field(default_factory=set)
    _messages: int = 0


def read_onnx(path: Path, data: bytes) -> OnnxFile:
    """
    Return what a file says; checks that weights outside it are in its own folder.

    Raises:
        PolicyError: it is no ONNX, or leads elsewhere.
    """
    file = OnnxFile(path, data)
    try:
        has_graph = False
        for number, value in _fields(data):
            if number == 7:
                has_graph = True
                _walk_graph(file, value, 0)
            elif number == 14:
                key, text = _pair(value)
                file.metadata[key] = text
            elif number == 25:  # functions
                for node in _parts(value, 7):
                    _walk_node(file, node, 0)
    except (ValueError, IndexError) as error:
        if isinstance(error, PolicyError):
            raise
        raise PolicyError('is no ONNX or TorchScript file, or is cut short') from None
    if not has_graph:
        raise PolicyError('is no ONNX file: it has no graph')
    for name in sorted(file.external):
        _check_external(path, name)
    return file


def _check_external(path: Path, name: str) -> None:
    """Check that a file of weights lies beside the network, whatever links say; and its size."""
    folder = path.parent.resolve()
    try:
        found = (folder / name).resolve()
        is_inside = found.is_relative_to(folder)
        size = found.stat().st_size if is_inside and found.is_file() else -1
    except (OSError, ValueError, RuntimeError):
        is_inside, size = True, -1
    if not is_inside:
        raise PolicyError(f'has weights in {name!r}, outside its folder: not read')
    if size < 0:
        raise PolicyError(f'has weights in {name!r}: no such file beside it')
    if size > LARGEST_NETWORK:
        raise PolicyError(f'{name}: {size / 1e6:.0f} MB is too much for a policy')


def _walk_graph(file: OnnxFile, graph: bytes, depth: int) -> None:
    for number, value in _fields(graph):
        if number == 1:
            _walk_node(file, value, depth)
        elif number == 5:
            _walk_tensor(file, value)
        elif number == 15:  # sparse: its values and indices
            for tensor in _parts(value, 1, 2):
                _walk_tensor(file, tensor)


def _walk_node(file: OnnxFile, node: bytes, depth: int) -> None:
    file._messages += 1
    if depth > DEEPEST or file._messages > MOST_MESSAGES:
        raise PolicyError('is no policy: its graph is too deep or too large')
    for attribute in _parts(node, 5):
        for number, value in _fields(attribute):
            if number in (5, 10):
                _walk_tensor(file, value)
            elif number in (6, 11):
                _walk_graph(file, value, depth + 1)
            elif number in (22, 23):
                for tensor in _parts(value, 1, 2):
                    _walk_tensor(file, tensor)


def _walk_tensor(file: OnnxFile, tensor: bytes) -> None:
    file._messages += 1
    for entry in _parts(tensor, 13):
        key, text = _pair(entry)
        if key == 'location':
            file.external.add(text)


def _pair(message: bytes) -> tuple[str, str]:
    """Return key and value of a StringStringEntryProto."""
    parts = dict(_fields(message))
    return parts.get(1, b'').decode(), parts.get(2, b'').decode()


def _parts(message: bytes, *numbers: int) -> Iterator[bytes]:
    """Yield the bytes of the fields of these numbers."""
    return (value for number, value in _fields(message) if number in numbers)


def _fields(message: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield number and bytes of each field that has bytes; ValueError or IndexError: cut short."""
    at, end = 0, len(message)
    while at < end:
        key, at = _varint(message, at)
        number, kind = key >> 3, key & 7
        if number == 0:
            raise ValueError('field 0')
        if kind == 0:
            _, at = _varint(message, at)
        elif kind in (1, 5):
            at += 8 if kind == 1 else 4
            if at > end:
                raise ValueError('cut short')
        elif kind == 2:
            length, at = _varint(message, at)
            if at + length > end:
                raise ValueError('cut short')
            yield number, message[at : at + length]
            at += length
        else:
            raise ValueError(f'wire type {kind}')


def _varint(message: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = message[at]
        at += 1
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            return value, at
        if shift > 63:
            raise ValueError('number too long')
