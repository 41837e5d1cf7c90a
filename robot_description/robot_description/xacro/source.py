# SPDX-License-Identifier: Apache-2.0
"""The files of a description before xacro: where each tag stands, which lack their prefix."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from dataclasses import field
from pathlib import Path
import re
import xml.parsers.expat

# A start tag, up to its end; `>` may stand in quotes.
START_TAG = re.compile(rb'<(?:[^<>"\']|"[^"]*"|\'[^\']*\')*>')
ATTRIBUTE = re.compile(rb'([^\s=<>/]+)\s*=\s*("[^"]*"|\'[^\']*\')')
PREFIX = 'xacro:'
# Tags that robots have anyway; a macro of such a name is called with its prefix or not meant.
URDF_TAGS = {
    *('robot', 'link', 'joint', 'gazebo', 'transmission', 'material', 'inertial', 'visual'),
    *('collision', 'origin', 'geometry', 'mass', 'inertia', 'limit', 'axis', 'parent', 'child'),
    *('box', 'cylinder', 'sphere', 'mesh', 'color', 'texture', 'plugin', 'sensor', 'actuator'),
    *('ros2_control', 'hardware', 'param', 'dynamics', 'mimic', 'type', 'name', 'camera', 'ray'),
}
# Tags of xacro itself, as they were written before 2014, each with an attribute that it has.
XACRO_TAGS = {
    **{'include': 'filename', 'property': 'name', 'macro': 'name', 'insert_block': 'name'},
    **{'arg': 'default', 'if': 'value', 'unless': 'value'},
}
# What holds tags of other programs, which may be called as these.
FOREIGN_TAGS = {'gazebo', 'ros2_control', 'transmission'}


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


def unprefixed_calls(sources: Mapping[Path, bytes]) -> Iterator[tuple[Path, SourceTag]]:
    """Yield the calls, each with its file, of macros that these files define, and of xacro's."""
    roots = {path: parse_source(data) for path, data in sources.items()}
    tags = (tag for root in roots.values() for tag in root.walk())
    names = (tag.attributes.get('name', '') for tag in tags if tag.name == f'{PREFIX}macro')
    macros = {name.removeprefix(PREFIX) for name in names} - URDF_TAGS
    for path, root in roots.items():
        if b'xacro' not in sources[path]:
            continue
        for tag in root.walk():
            is_meant = tag.name in macros or XACRO_TAGS.get(tag.name) in tag.attributes
            if is_meant and not any(above.name in FOREIGN_TAGS for above in tag.above):
                yield path, tag
