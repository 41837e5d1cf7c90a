# SPDX-License-Identifier: Apache-2.0
"""Xacro to URDF with our own `$(find)`, so that it works with and without a ROS installation."""

from collections.abc import Iterator, Mapping, Sequence
import contextlib
from pathlib import Path
from typing import Any
import xml.parsers.expat

import xacro
from xacro import substitution_args

from robot_description.errors import DescriptionError
from robot_description.packages import PackageFinder


def expand(
    path: Path, arguments: Mapping[str, str] | None = None, search: Sequence[Path] = ()
) -> str:
    """
    Return the URDF text of a xacro or URDF file.

    `arguments` are xacro args; `search` are folders in which `$(find)` looks first.

    Raises:
        DescriptionError: one line with the file, and the included file where it went wrong.
    """
    if not path.is_file():
        raise DescriptionError(f'{path}: no such file')
    try:
        with _own_find(PackageFinder(search, path)):
            document = xacro.process_file(str(path), mappings=dict(arguments or {}))
    except Exception as error:  # xacro raises a dozen unrelated types
        raise DescriptionError(f'{path}: {_included(path)}{_reason(error)}') from None
    return str(document.toprettyxml(indent='  '))


@contextlib.contextmanager
def _own_find(finder: PackageFinder) -> Iterator[None]:
    """Answer `$(find pkg)` from our search path; xacro itself asks ament_index_python only."""

    def find(package: str) -> str:
        return str(finder.find(package))

    module: Any = substitution_args
    previous = module._eval_find
    module._eval_find = module._eval_dict['find'] = find
    try:
        yield
    finally:
        module._eval_find = module._eval_dict['find'] = previous


def _included(path: Path) -> str:
    """Return the file that xacro was reading, unless it is `path` itself."""
    deepest = (xacro.filestack or [None])[-1]
    return f'in {deepest}: ' if deepest and Path(deepest) != path else ''


def _reason(error: BaseException) -> str:
    """Return what went wrong in one line, without the layers that xacro wraps around it."""
    cause = getattr(error, 'exc', None)
    if isinstance(cause, DescriptionError):
        return _reason(cause)
    text = ' '.join(str(error).split()) or type(error).__name__
    is_syntax = isinstance(error, xml.parsers.expat.ExpatError)
    return f'not well-formed XML: {text}' if is_syntax else text
