# SPDX-License-Identifier: Apache-2.0
"""Macro calls that lack `xacro:`; xacro copies them into the robot without a word."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from robot_description.source_xml import parse_source
from robot_description.source_xml import SourceTag

PREFIX = 'xacro:'
# Tags that robots have anyway; a macro of such a name is called with its prefix or not meant.
URDF_TAGS = {
    *('robot', 'link', 'joint', 'gazebo', 'transmission', 'material', 'inertial', 'visual'),
    *('collision', 'origin', 'geometry', 'mass', 'inertia', 'limit', 'axis', 'parent', 'child'),
    *('box', 'cylinder', 'sphere', 'mesh', 'color', 'texture', 'plugin', 'sensor', 'actuator'),
    *('ros2_control', 'hardware', 'param', 'dynamics', 'mimic', 'type', 'name', 'camera', 'ray'),
}


def defined_macros(roots: Iterable[SourceTag]) -> set[str]:
    """Return the names of the macros that files define."""
    tags = (tag for root in roots for tag in root.walk())
    names = (tag.attributes.get('name', '') for tag in tags if tag.name == f'{PREFIX}macro')
    return {name.removeprefix(PREFIX) for name in names}


def unprefixed_calls(sources: Mapping[Path, bytes]) -> Iterator[tuple[Path, SourceTag]]:
    """Yield the calls, each with its file, of macros that these files define."""
    roots = {path: parse_source(data) for path, data in sources.items()}
    macros = defined_macros(roots.values()) - URDF_TAGS
    for path, root in roots.items():
        for tag in root.walk():
            if tag.name in macros and not any(above.name == 'gazebo' for above in tag.above):
                yield path, tag
