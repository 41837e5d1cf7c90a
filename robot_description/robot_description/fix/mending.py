# SPDX-License-Identifier: Apache-2.0
"""Mends what can be mended in a description, in its text; nothing is written but on request."""

from collections.abc import Callable, Iterator, Mapping, Sequence
import difflib
import os
from pathlib import Path
import re
import shutil
from typing import NamedTuple

from wasd_core.errors import DescriptionError, one_line
from wasd_core.output_file import identity, OutputFile

from robot_description.fix.edits import (
    add_footprint,
    correct_mesh_paths,
    drop_materials,
    prefix_macros,
    rename_joints,
    swap_sides,
)
from robot_description.fix.workspace import Edit, Workspace
from robot_description.lint.rules import Finding
from robot_description.lint.session import lint
from robot_description.packages import own_folder, source_of
from robot_description.xacro.session import XacroSession

# What diff and patch call a line; Python's splitlines knows other ends, too.
LINE = re.compile(r'[^\n]*\n|[^\n]+')
# By code, in this order: what a macro makes is seen only when it is called.
FIXES: dict[str, Callable[[Workspace], Iterator[Edit]]] = {
    'unprefixed-macro': prefix_macros,
    'repeated-material': drop_materials,
    'swapped-sides': lambda workspace: swap_sides(workspace, 'left'),
    'swapped-ends': lambda workspace: swap_sides(workspace, 'front'),
    'missing-footprint': add_footprint,
    'wrong-mesh-path': correct_mesh_paths,
}


class Fixes(NamedTuple):
    """What was mended: texts before and after by file, codes, and what is left to do."""

    before: Mapping[Path, bytes]
    after: Mapping[Path, bytes]
    mended: tuple[str, ...]
    left: tuple[Finding, ...]

    def diff(self) -> str:
        """Return the changes as a unified diff, which `patch -p0` applies."""
        return ''.join(
            _diff(path, self.before[path].decode(), text.decode())
            for path, text in sorted(self.after.items())
        )


def mend(
    path: Path,
    arguments: Mapping[str, str] | None = None,
    search: Sequence[Path] = (),
    renames: Mapping[str, str] | None = None,
    only: Sequence[str] = (),
) -> Fixes:
    """
    Mend what lint finds and a program can mend; rename joints. Nothing is written.

    `only` are the codes to mend, all of FIXES without it.

    Raises:
        DescriptionError: the file cannot be opened, or a rename cannot be done.
    """
    workspace = Workspace(source_of(path), arguments or {}, search)
    mended = []
    for code, fix in FIXES.items():
        if (not only or code in only) and _mend(workspace, code, fix):
            mended.append(code)
    if renames:
        workspace.apply(rename_joints(workspace, renames))
        joints = workspace.model().joints
        for old, new in renames.items():
            if new not in joints:
                raise DescriptionError(
                    f'--rename {old}: cannot be done here: the name is made in a file of another '
                    'package, or in a way that cannot be changed'
                )
    left = tuple(workspace.lint())
    return Fixes(workspace.original, dict(workspace.changed), tuple(mended), left)


def _mend(workspace: Workspace, code: str, fix: Callable[[Workspace], Iterator[Edit]]) -> bool:
    """Apply a fix while it helps; take it back where it does not."""
    before, unreadable = _count(workspace, code), _count(workspace, 'not-readable')
    if not before:
        return False
    kept = dict(workspace.changed)
    try:
        workspace.apply(fix(workspace))
        helps = _count(workspace, code) < before
        helps = helps and _count(workspace, 'not-readable') <= unreadable
    except DescriptionError:
        helps = False
    if not helps:
        workspace.changed = kept
    return helps


def _count(workspace: Workspace, code: str) -> int:
    return sum(one.rule.code == code for one in workspace.lint())


def _diff(path: Path, before: str, after: str) -> str:
    name = os.path.relpath(path) if path.is_relative_to(Path.cwd()) else str(path)
    lines = difflib.unified_diff(LINE.findall(before), LINE.findall(after), name, name)
    end = '\n\\ No newline at end of file\n'
    return ''.join(line if line.endswith('\n') else line + end for line in lines)


def write_mended(fixes: Fixes, description: Path, output: Path) -> Path:
    """
    Write the mended description and return where it is.

    A file gets the description, when nothing else changed; a folder gets a copy of its package.

    Raises:
        DescriptionError: that would write over something, or cannot be written.
    """
    description = source_of(description)
    if identity(output) in {identity(file) for file in fixes.before}:
        raise DescriptionError(f'--output {output}: is a source; it is not overwritten')
    others = [file for file in fixes.after if file != description]
    try:
        if output.is_dir():
            return _copy_package(fixes, description, output)
        if others:
            raise DescriptionError(
                f'--output {output}: {others[0]} changes, too: name a folder that exists, which '
                'gets a copy of the package'
            )
        text = fixes.after.get(description, fixes.before[description])
        OutputFile(output, '--output').write(text)
        return output
    except OSError as error:
        raise DescriptionError(f'--output {output}: {one_line(error)}') from None


def lost_there(
    fixes: Fixes, output: Path, arguments: Mapping[str, str], search: Sequence[Path]
) -> tuple[Finding, ...]:
    """Return the errors of what was written that come of its place: it names files beside it."""
    if not output.is_file():  # a pipe
        return ()
    known = {one.rule.code for one in fixes.left}
    found = lint(XacroSession(output, arguments, search))
    return tuple(one for one in found if one.is_error and one.rule.code not in known)


def _copy_package(fixes: Fixes, description: Path, output: Path) -> Path:
    folder = own_folder(description)
    target = output / folder.name
    if target.exists():
        raise DescriptionError(f'--output {output}: {target} is there already')
    if output.resolve().is_relative_to(folder.resolve()):
        raise DescriptionError(f'--output {output}: lies within the package {folder}')
    shutil.copytree(folder, target, symlinks=True)
    for file, text in fixes.after.items():
        copy = target / file.resolve().relative_to(folder.resolve())
        copy.unlink()  # which may be a link
        copy.write_bytes(text)
    return target / description.resolve().relative_to(folder.resolve())
