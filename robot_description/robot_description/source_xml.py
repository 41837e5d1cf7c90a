# SPDX-License-Identifier: Apache-2.0
"""XML as text: every tag with its place in the bytes, to be changed where it stands."""

from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import field
import re
import xml.parsers.expat

# A start tag, up to its end; `>` may stand in quotes.
START_TAG = re.compile(rb'<(?:[^<>"\']|"[^"]*"|\'[^\']*\')*>')
ATTRIBUTE = re.compile(rb'([^\s=<>/]+)\s*=\s*("[^"]*"|\'[^\']*\')')


@dataclass(eq=False)
class SourceTag:
    """An element: `start`..`end` are the bytes of its start tag, `close` is where `</` begins."""

    name: str
    attributes: dict[str, str]
    start: int
    end: int
    line: int
    column: int
    parent: 'SourceTag | None' = None
    close: int | None = None
    children: list['SourceTag'] = field(default_factory=list)

    def walk(self) -> Iterator['SourceTag']:
        """Yield it and everything in it."""
        yield self
        for child in self.children:
            yield from child.walk()

    @property
    def above(self) -> Iterator['SourceTag']:
        """What it stands in, the nearest first."""
        here = self.parent
        while here is not None:
            yield here
            here = here.parent

    def value_span(self, data: bytes, attribute: str) -> tuple[int, int] | None:
        """Return where an attribute's value is, without its quotes."""
        for match in ATTRIBUTE.finditer(data, self.start, self.end):
            if match[1].decode() == attribute:
                return match.start(2) + 1, match.end(2) - 1
        return None


def parse_source(data: bytes) -> SourceTag:
    """Return the root of well-formed XML in UTF-8."""
    parser = xml.parsers.expat.ParserCreate()
    top: list[SourceTag] = []
    open_tags: list[SourceTag] = []

    def enter(name: str, attributes: dict[str, str]) -> None:
        start = parser.CurrentByteIndex
        match = START_TAG.match(data, start)
        end = match.end() if match else start
        parent = open_tags[-1] if open_tags else None
        line, column = parser.CurrentLineNumber, parser.CurrentColumnNumber
        tag = SourceTag(name, attributes, start, end, line, column, parent)
        (parent.children if parent else top).append(tag)
        open_tags.append(tag)

    def leave(_: str) -> None:
        tag = open_tags.pop()
        if data[tag.end - 2 : tag.end] != b'/>':
            tag.close = parser.CurrentByteIndex

    parser.StartElementHandler = enter
    parser.EndElementHandler = leave
    parser.Parse(data, True)
    return top[0]
