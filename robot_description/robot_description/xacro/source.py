# SPDX-License-Identifier: Apache-2.0
"""Files of a description before xacro: what they are, where tags stand, which lack a prefix."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from dataclasses import field
from pathlib import Path
import re
import xml.parsers.expat

from wasd_core.safe_files import LocatedError
from wasd_core.safe_files import Place

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


WANTED = 'wanted URDF or xacro'
# What a file begins with: what it is, and the cure.
BEGINNINGS = (
    (rb'\x1f\x8b', 'is gzipped', 'unpack it: gunzip'),
    (rb'PK\x03\x04', 'is a zip archive', 'unpack it: unzip'),
    (rb'\x7fELF', 'is a program', f'name the robot instead: {WANTED}'),
    (rb'version https://git-lfs', 'is a pointer of Git LFS, not the file itself',
     'get the file: git lfs install, then git lfs pull in its clone'),
    (rb'(?is)\s*(<!--.*?-->\s*)*<!doctype html', 'is a web page (HTML), not the file itself',
     'get the file itself: on GitHub by the button "Raw", or clone the repository'),
    (rb'\s*\{', f'is JSON, {WANTED}', 'name the .urdf or .xacro of the robot'),
    (rb'(%YAML|---|(\s*#[^\n]*\n|\s)*[\w/.~-]+:(\s|$))', f'is YAML, {WANTED}',
     'name the .urdf or .xacro of the robot'),
    (rb'(\s*#[^\n]*\n|\s)*(import|from) \w', f'is a Python program, {WANTED}',
     'name the .urdf or .xacro that it loads'),
    (rb'solid ', 'is a mesh (STL)', 'name the .urdf or .xacro that uses it'),
)  # fmt: skip
# Root elements of other XML.
ROOTS = {
    'sdf': ("SDF, Gazebo's format", 'name the .urdf or .xacro that it was made from'),
    'gazebo': ("SDF, Gazebo's format", 'name the .urdf or .xacro that it was made from'),
    'world': ("a world of Gazebo's", 'name the .urdf or .xacro of the robot'),
    'mujoco': ("MJCF, MuJoCo's format",
               'name the .urdf or .xacro of the robot; as a world it goes: --world FILE'),
    'html': ('a web page (HTML)',
             'get the file itself: on GitHub by the button "Raw", or clone the repository'),
    'launch': ('a launch file', 'name the .urdf or .xacro that it loads'),
    'package': ("a package's manifest", 'name a .urdf or .xacro of the package'),
    'COLLADA': ('a mesh (Collada)', 'name the .urdf or .xacro that uses it'),
}  # fmt: skip
ROOT = re.compile(rb'<([A-Za-z_][^\s/>]*)')
DECLARED = re.compile(rb'\s*<\?xml[^>]*encoding\s*=\s*["\']([\w.-]+)')


def check_format(data: bytes, path: Path) -> None:
    """
    Accept what may be a robot's XML.

    Raises:
        LocatedError: what it is instead, and what to do.
    """
    if not data.strip(b'\xef\xbb\xbf\x00 \t\r\n'):
        _refuse(path, 1, 'is empty', 'get the file again')
    for beginning, what, cure in BEGINNINGS:
        if re.match(beginning, data.removeprefix(b'\xef\xbb\xbf')):
            _refuse(path, 1, what, cure)
    if b'\0' in data and data[:2] not in (b'\xff\xfe', b'\xfe\xff'):
        what = 'UTF-16 without a mark' if data[1:2] == b'\0' or data[:1] == b'\0' else 'no text'
        _refuse(path, 1, f'is {what}', 'save it as UTF-8')
    root = ROOT.search(re.sub(rb'(?s)<!--.*?-->|<\?.*?\?>|<!DOCTYPE[^>\[]*>', b'', data))
    name = root[1].decode(errors='replace') if root else ''
    if root and name in ROOTS:
        what, cure = ROOTS[name]
        _refuse(path, data[: data.find(root[0])].count(b'\n') + 1, f'is {what}, {WANTED}', cure)
    _check_encoding(data, path)


def _check_encoding(data: bytes, path: Path) -> None:
    """Bytes are what the first line says of them, or UTF-8."""
    declared = DECLARED.match(data)
    name = declared[1].decode() if declared else 'UTF-8'
    if name.upper() not in ('UTF-8', 'UTF8') or data[:2] in (b'\xff\xfe', b'\xfe\xff'):
        return
    try:
        data.decode()
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b'\n') + 1
        what = f'has the byte 0x{data[error.start]:02x}, which is no {name}'
        cure = 'save it as UTF-8, or say what it is: <?xml version="1.0" encoding="ISO-8859-1"?>'
        _refuse(path, line, what, cure)


def _refuse(path: Path, line: int, what: str, cure: str) -> None:
    raise LocatedError(Place(path, line), f'{what}; {cure}')
