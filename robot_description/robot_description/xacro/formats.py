# SPDX-License-Identifier: Apache-2.0
"""Files that are handed over as a robot's description and are something else."""

from pathlib import Path
import re

from wasd_core.safe_files import LocatedError
from wasd_core.safe_files import Place

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
