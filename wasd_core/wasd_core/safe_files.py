# SPDX-License-Identifier: Apache-2.0
"""Reads untrusted files: of bounded size, XML with line numbers."""

import errno
import os
from pathlib import Path
import stat
import time
from typing import Any, NamedTuple
from xml.dom import expatbuilder, minidom, Node
import xml.parsers.expat

from wasd_core.errors import DescriptionError, one_line

KEY = 'place'


class Place(NamedTuple):
    """A line of a file, counted from 1, and the column where an element begins, from 0."""

    file: Path
    line: int
    column: int = 0

    def __str__(self) -> str:
        """Return it as compilers print it."""
        return f'{self.file}:{self.line}'


class LocatedError(DescriptionError):
    """Something is wrong at a line of a file; `via` is the line from which xacro came there."""

    def __init__(self, place: Place, reason: str, via: Place | None = None) -> None:
        super().__init__(f'{place}: {reason}' + (f' (reached from {via})' if via else ''))
        self.place = place
        self.reason = reason


class _Builder(expatbuilder.ExpatBuilderNS):
    """Builds a document whose elements remember their line, and whose copies do, too."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self._file = file

    def start_element_handler(self, name: str, attributes: list[str]) -> None:
        super().start_element_handler(name, attributes)
        parser = self.getParser()
        place = Place(self._file, parser.CurrentLineNumber, parser.CurrentColumnNumber)
        self.curNode.setUserData(KEY, place, _COPY_PLACE)


class _CopyPlace:
    """Told by minidom when an element is copied, as a macro's are."""

    def handle(self, operation: int, key: str, place: Place, source: Node, copy: Any) -> None:
        if copy is not None:
            copy.setUserData(key, place, self)


_COPY_PLACE = _CopyPlace()


def parse_with_places(data: bytes, file: Path) -> minidom.Document:
    """Return a document of well-formed XML, see `place_of`."""
    return _Builder(file).parseString(data)


def place_of(node: Any) -> Place | None:
    """Return where an element stood in its file, or the nearest one around it that knows."""
    while node is not None:
        place = node.getUserData(KEY) if isinstance(node, minidom.Element) else None
        if isinstance(place, Place):
            return place
        node = node.parentNode
    return None


# The largest of example-robot-data have 0.2 MB and 4 000 elements.
LARGEST_FILE = 4_000_000
MOST_ELEMENTS = 30_000
# Python's own recursion limit lets no more levels through xacro.
DEEPEST_XML = 60
# So long we wait for a pipe's writer, and so often we look [s].
PATIENCE, POLL_PERIOD = 5.0, 0.01
NO_NAMESPACE = xml.parsers.expat.errors.XML_ERROR_UNBOUND_PREFIX


def read_file(path: Path, largest: int = LARGEST_FILE) -> bytes:
    """
    Return a file's bytes; never waits for a pipe or a device.

    Raises:
        DescriptionError: it cannot be read, is no ordinary file, or has more than `largest` bytes.
    """
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with open(handle, 'rb') as file:
            status = os.fstat(handle)
            is_file = stat.S_ISREG(status.st_mode)
            data = file.read(largest + 1) if is_file else b''
    except FileNotFoundError:
        raise DescriptionError(f'{path}: no such file') from None
    except IsADirectoryError:
        raise DescriptionError(f'{path}: is a folder, wanted a file') from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        is_circle = isinstance(error, OSError) and error.errno == errno.ELOOP
        reason = 'leads nowhere (a circle of links?)' if is_circle else one_line(error)
        raise DescriptionError(f'{path}: {reason}') from None
    if not is_file:
        raise DescriptionError(f'{path}: is a device or pipe, wanted a file')
    if len(data) > largest:
        size = max(status.st_size, len(data))
        raise DescriptionError(
            f'{path}: {size / 1e6:.1f} MB is too much, at most {largest / 1e6:.1f} MB are read'
        )
    return data


def read_beginning(path: Path, most: int) -> bytes:
    """
    Return at most so many bytes of a file, device or pipe, whose writer may come a little later.

    Raises:
        OSError: it cannot be read, or nothing comes for PATIENCE.
        ValueError: a NUL in the name.
    """
    data, deadline = b'', time.monotonic() + PATIENCE
    flags = os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC
    with open(os.open(path, flags), 'rb') as file:
        is_pipe = stat.S_ISFIFO(os.fstat(file.fileno()).st_mode)
        while len(data) < most:
            try:
                piece = os.read(file.fileno(), most - len(data))
            except BlockingIOError:
                piece = None  # more is to come
            if piece:
                data, deadline = data + piece, time.monotonic() + PATIENCE
            elif piece == b'' and (data or not is_pipe):
                break
            elif time.monotonic() > deadline:
                raise OSError(errno.EAGAIN, f'nothing comes for {PATIENCE:g} s')
            else:
                time.sleep(POLL_PERIOD)
    return data


def check_xml(data: bytes | str, file: Path | None = None) -> None:
    """
    Accept XML that is well-formed, not too deep or long, and defines no entities.

    Raises:
        DescriptionError: what is wrong, and the line; a LocatedError when it came from a file.
    """
    parser = xml.parsers.expat.ParserCreate(namespace_separator=' ')
    depth = count = 0

    def fail(reason: str) -> None:
        raise _error(file, parser.CurrentLineNumber, reason)

    def enter(name: str, attributes: dict[str, str]) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        if depth > DEEPEST_XML:
            fail(f'elements nested more than {DEEPEST_XML} deep')
        if count > MOST_ELEMENTS:
            fail(f'more than {MOST_ELEMENTS} elements')

    def leave(name: str) -> None:
        nonlocal depth
        depth -= 1

    def refuse_entity(name: str, *rest: Any) -> None:
        fail(f'defines the entity {name!r}: entities are not read')

    parser.StartElementHandler = enter
    parser.EndElementHandler = leave
    parser.EntityDeclHandler = refuse_entity
    try:
        parser.Parse(data, True)
    except xml.parsers.expat.ExpatError as error:
        reason = xml.parsers.expat.ErrorString(error.code)
        if error.code == xml.parsers.expat.errors.codes[NO_NAMESPACE]:
            reason += ' (<robot> needs xmlns:xacro="http://www.ros.org/wiki/xacro")'
        column = error.offset + 1
        text = f'not well-formed XML: {reason}, column {column}'
        raise _error(file, error.lineno, text) from None
    except DescriptionError:
        raise
    except (LookupError, ValueError) as error:  # an encoding that is not known, or not kept to
        raise _error(file, 1, f'not well-formed XML: {error}') from None


def _error(file: Path | None, line: int, reason: str) -> DescriptionError:
    if file is None:
        return DescriptionError(f'{reason} (line {line})')
    return LocatedError(Place(file, line), reason)
