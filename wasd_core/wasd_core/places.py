# SPDX-License-Identifier: Apache-2.0
"""Where in a file something stands: XML elements that know their line, through xacro and back."""

from pathlib import Path
from typing import Any, NamedTuple
from xml.dom import expatbuilder
from xml.dom import minidom
from xml.dom import Node

from wasd_core.errors import DescriptionError

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
