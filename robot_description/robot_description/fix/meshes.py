# SPDX-License-Identifier: Apache-2.0
"""Writes the path of a mesh that was found elsewhere than its path says."""

from collections.abc import Iterator
from xml.sax.saxutils import escape

from robot_description.fix.workspace import Edit
from robot_description.fix.workspace import Workspace
from robot_description.lint.meshes import better_url

QUOTES = {'"': '&quot;', "'": '&apos;'}


def correct_mesh_paths(workspace: Workspace) -> Iterator[Edit]:
    """Replace the paths that were repaired while searching, where they are written out."""
    repairs = workspace.meshes().repairs
    found = {record.url: record.file for record in repairs if record.file is not None}
    for path, data in workspace.sources().items():
        for tag in workspace.tags(path).walk():
            file = found.get(tag.attributes.get('filename', '')) if tag.name == 'mesh' else None
            span = tag.value_span(data, 'filename')
            if file is not None and span is not None:
                yield Edit(path, *span, escape(better_url(file), QUOTES))
