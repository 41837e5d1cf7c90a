# SPDX-License-Identifier: Apache-2.0
"""Files of a description before xacro: what they are, where tags stand, which lack a prefix."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
import re
import xml.parsers.expat

from wasd_core.safe_files import LocatedError, Place

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
# What comes in place of a file, also of a mesh: its beginning, what it is, and the cure.
IN_ITS_PLACE = (
    (rb'\x1f\x8b', 'is gzipped', 'unpack it: gunzip'),
    (rb'PK\x03\x04', 'is a zip archive', 'unpack it: unzip'),
    (rb'BZh', 'is packed by bzip2', 'unpack it: bunzip2'),
    (rb'\xfd7zXZ', 'is packed by xz', 'unpack it: unxz'),
    (rb'version https://git-lfs', 'is a pointer of Git LFS, not the file itself',
     'get the file: git lfs install, then git lfs pull in its clone'),
    (rb'(?is)(?:\s|<!--(?:(?!-->).)*-->|<\?[^>]*>)*+<(?:!doctype )?html\b',
     'is a web page (HTML), not the file itself',
     'get the file itself: on GitHub by the button "Raw", or clone the repository'),
)  # fmt: skip
BEGINNINGS = (
    *IN_ITS_PLACE,
    (rb'\x7fELF', 'is a program', f'name the robot instead: {WANTED}'),
    (rb'\s*\{', f'is JSON, {WANTED}', 'name the .urdf or .xacro of the robot'),
    (rb'(%YAML|---|(?:#[^\n]*\n|\s)*+[\w/.~-]+:(\s|$))', f'is YAML, {WANTED}',
     'name the .urdf or .xacro of the robot'),
    (rb'(?:#[^\n]*\n|\s)*+(import|from) \w', f'is a Python program, {WANTED}',
     'name the .urdf or .xacro that it loads'),
    (rb'solid ', 'is a mesh (STL)', 'name the .urdf or .xacro that uses it'),
    (rb'(glTF|ply\r?\n|(?:#[^\n]*\n|\s)*+(mtllib|o|v) \S)', 'is a mesh (glTF, PLY or OBJ)',
     'name the .urdf or .xacro that uses it'),
    (rb'(PXR-USDC|#usda )', f"is USD, Isaac Sim's format, {WANTED}",
     'name the .urdf or .xacro that it was made from'),
    (rb'(\x89PNG|\xff\xd8\xff|%PDF-)', f'is a picture or a document, {WANTED}',
     'name the .urdf or .xacro of the robot'),
)  # fmt: skip
# Of MoveIt's format, which has the same root as URDF and no links.
SRDF_TAGS = ('group', 'group_state', 'virtual_joint', 'end_effector', 'disable_collisions')
# A mesh in bytes: what stands before its triangles, which end with their number; and each.
STL_HEADER, STL_TRIANGLE = 84, 50
# What may stand before a declaration: marks, spaces, remarks; words, of which there are few.
LEAD = re.compile(rb'(?:\xef\xbb\xbf|\s|<!--.*?-->)*', re.DOTALL)
WORDS = re.compile(rb'[^<]{1,2000}(?=<\?xml|<robot)')
DECLARATION = re.compile(rb'<\?xml[^>]*\?>')
PREFIXED = re.compile(rb'</?([A-Za-z_][\w.-]*):|\s([A-Za-z_][\w.-]*):[\w.-]+\s*=\s*["\']')
DECLARES = re.compile(rb'xmlns:([\w.-]+)\s*=')
ROBOT = re.compile(rb'<robot(?=[\s>/])')
# Prefixes that mean something here: without their namespace a file is wrong.
OUR_PREFIXES = {b'xml', b'xmlns', b'xacro'}
# Root elements of other XML.
ROOTS = {
    'sdf': ("SDF, Gazebo's format", 'name the .urdf or .xacro that it was made from'),
    'gazebo': ("SDF, Gazebo's format", 'name the .urdf or .xacro that it was made from'),
    'world': ("a world of Gazebo's", 'name the .urdf or .xacro of the robot'),
    'mujoco': ("MJCF, MuJoCo's format",
               'name the .urdf or .xacro of the robot; as a world it goes: --world FILE'),
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
    if _is_stl(data):
        _refuse(path, 1, 'is a mesh (STL)', 'name the .urdf or .xacro that uses it')
    for beginning, what, cure in BEGINNINGS:
        if re.match(beginning, data.removeprefix(b'\xef\xbb\xbf')):
            _refuse(path, 1, what, cure)
    if b'\0' in data and data[:2] not in (b'\xff\xfe', b'\xfe\xff'):
        what = 'UTF-16 without a mark' if data[1:2] == b'\0' or data[:1] == b'\0' else 'no text'
        _refuse(path, 1, f'is {what}', 'save it as UTF-8')
    root = ROOT.search(_bare(data))
    name = root[1].decode(errors='replace') if root else ''
    if root and name in ROOTS:
        what, cure = ROOTS[name]
        _refuse(path, data[: data.find(root[0])].count(b'\n') + 1, f'is {what}, {WANTED}', cure)
    if _is_srdf(data):
        what = f"is SRDF, MoveIt's groups of a robot's joints, {WANTED}"
        _refuse(path, 1, what, 'name the .urdf or .xacro that it belongs to')
    _check_encoding(data, path)


def _bare(data: bytes) -> bytes:
    """Return XML without comments and processing instructions, in a time that grows with it."""
    for opening, closing in ((b'<!--', b'-->'), (b'<?', b'?>')):
        parts, at = [], 0
        while (start := data.find(opening, at)) >= 0:
            end = data.find(closing, start + len(opening))
            if end < 0:
                break
            parts.append(data[at:start])
            at = end + len(closing)
        data = b''.join((*parts, data[at:]))
    return data


def _is_stl(data: bytes) -> bool:
    """Whether data are as long as a mesh of so many triangles."""
    count = int.from_bytes(data[STL_HEADER - 4 : STL_HEADER], 'little')
    return count > 0 and len(data) == STL_HEADER + count * STL_TRIANGLE


def _is_srdf(data: bytes) -> bool:
    """Whether it has what MoveIt knows of a robot, and no links, also none from elsewhere."""
    if re.search(rb'<(xacro:)?(link|include)[\s>/]', data):
        return False
    return any(re.search(rb'<%s[\s>/]' % tag.encode(), data) for tag in SRDF_TAGS)


def tidy(data: bytes) -> tuple[bytes, list[str]]:
    """
    Return XML without what parsers stumble over, and what was passed over, in words; lines stay.

    That is: marks, spaces, remarks and words before the declaration, zeros at the end, and
    prefixes of other programs that nobody declared.
    """
    notes: list[str] = []
    if data[:2] in (b'\xff\xfe', b'\xfe\xff'):
        return data, notes
    whole = data.rstrip(b'\0 \t\r\n')
    if whole.endswith(b'>') and b'\0' in data[len(whole) :]:
        data = whole
    words = WORDS.match(data)
    if words and words[0].strip(b'\xef\xbb\xbf \t\r\n'):
        notes.append('text before the first tag is ignored')
        data = _blank(words[0]) + data[words.end() :]
    lead = LEAD.match(data)
    assert lead is not None
    start = lead.end()
    declaration = DECLARATION.match(data, start)
    if declaration and data[:start] not in (b'', b'\xef\xbb\xbf'):
        encoding = DECLARED.match(declaration[0])
        rest = data[declaration.end() :]
        if encoding and encoding[1].upper() not in (b'UTF-8', b'UTF8'):
            rest = _recoded(rest, encoding[1].decode())
        data = data[:start].replace(b'\xef\xbb\xbf', b'   ') + _blank(declaration[0]) + rest
    elif data[:start].count(b'\xef\xbb\xbf') > 1:
        data = data[:start].replace(b'\xef\xbb\xbf', b'   ') + data[start:]
    found = {one or other for one, other in PREFIXED.findall(data)}
    undeclared = sorted(found - {*DECLARES.findall(data)} - OUR_PREFIXES)
    root = ROBOT.search(data)
    if undeclared and root:
        names = b''.join(b' xmlns:%s="urn:of:others"' % prefix for prefix in undeclared)
        data = data[: root.end()] + names + data[root.end() :]
        shown = ', '.join(prefix.decode() for prefix in undeclared)
        notes.append(f'undeclared prefixes are treated as those of other programs: {shown}')
    return data, notes


def _blank(data: bytes) -> bytes:
    """Return spaces in place of all but line ends."""
    return re.sub(rb'[^\n]', b' ', data)


def _recoded(data: bytes, encoding: str) -> bytes:
    try:
        return data.decode(encoding).encode()
    except (LookupError, ValueError):
        return data


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
