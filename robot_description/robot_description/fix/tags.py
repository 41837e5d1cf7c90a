# SPDX-License-Identifier: Apache-2.0
"""Fixes that need the text only: the prefix of macro calls, materials too many."""

from collections.abc import Iterator
from pathlib import Path

from robot_description.fix.workspace import Edit
from robot_description.fix.workspace import Workspace
from robot_description.macro_calls import PREFIX
from robot_description.macro_calls import unprefixed_calls
from robot_description.source_xml import SourceTag


def prefix_macros(workspace: Workspace) -> Iterator[Edit]:
    """Write `xacro:` before macro calls that lack it."""
    own = workspace.sources()
    for path, tag in unprefixed_calls(workspace.texts()):
        if path not in own:
            continue
        yield Edit(path, tag.start + 1, tag.start + 1, PREFIX)
        if tag.close is not None:
            yield Edit(path, tag.close + 2, tag.close + 2, PREFIX)


def drop_materials(workspace: Workspace) -> Iterator[Edit]:
    """Leave the first of several materials of a visual."""
    for path, data in workspace.sources().items():
        for visual in workspace.tags(path).walk():
            if visual.name == 'visual':
                materials = [child for child in visual.children if child.name == 'material']
                for material in materials[1:]:
                    yield _without(path, data, material)


def _without(path: Path, data: bytes, tag: SourceTag) -> Edit:
    """Take out an element, with its line when nothing else stands there."""
    start = tag.start
    end = tag.end if tag.close is None else data.index(b'>', tag.close) + 1
    line_start = data.rfind(b'\n', 0, start) + 1
    line_end = data.find(b'\n', end) + 1
    is_alone = not data[line_start:start].strip() and not data[end:line_end].strip()
    if is_alone and line_start and line_end:
        start, end = line_start, line_end
    return Edit(path, start, end, '')
