# SPDX-License-Identifier: Apache-2.0
"""Xacro to URDF with our own `$(find)`, so that it works with and without a ROS installation."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.dom import minidom

from wasd_core.errors import DescriptionError
from wasd_core.safe_files import LocatedError
from wasd_core.safe_files import Place

from robot_description.reach import Reach
from robot_description.xacro_session import XacroSession

LONGEST_REASON = 300


class Expansion(NamedTuple):
    """An expanded file: its elements know their places; `warnings` are xacro's, `files` read."""

    document: minidom.Document
    warnings: tuple[tuple[Place | None, str], ...]
    files: tuple[Path, ...]

    @property
    def urdf(self) -> str:
        """The URDF text."""
        return str(self.document.toprettyxml(indent='  '))


def expand(
    path: Path, arguments: Mapping[str, str] | None = None, search: Sequence[Path] = ()
) -> str:
    """
    Return the URDF text of a xacro or URDF file.

    `arguments` are xacro args; `search` are folders in which `$(find)` looks first.

    Raises:
        DescriptionError: one line with the file and, where there is one, the line.
    """
    return expand_document(path, arguments, search).urdf


def expand_document(
    path: Path, arguments: Mapping[str, str] | None = None, search: Sequence[Path] = ()
) -> Expansion:
    """
    Return what a xacro or URDF file expands to, as elements that know their places.

    Raises:
        DescriptionError: see `expand`.
    """
    return run_session(XacroSession(path, arguments or {}, Reach(path, search)))


def run_session(session: XacroSession) -> Expansion:
    """
    Return what a session expands to.

    Raises:
        DescriptionError: see `expand`.
    """
    try:
        document = session.run()
    except Exception as error:  # xacro raises a dozen unrelated types
        raise _located(error, session) from None
    return Expansion(document, tuple(session.warnings), tuple(session.sources))


def _located(error: Exception, session: XacroSession) -> DescriptionError:
    """Return the error with the place where xacro was."""
    place = session.failed_at
    if place is None and isinstance(error, DescriptionError):  # the file itself
        return error
    if isinstance(error, LocatedError):  # in a file that was to be included there
        return LocatedError(error.place, error.reason, place)
    place = place or Place(session.path, 1)
    via = session.called_from if place.file != session.path else None
    return LocatedError(place, _reason(error), via)


def _reason(error: BaseException) -> str:
    """Return what went wrong in one line, without the layers that xacro wraps around it."""
    suffix = ''
    while (cause := getattr(error, 'exc', None)) is not None:
        message = str(error.args[0] or '') if error.args else ''
        if (
            message
            and not message.startswith('<class')
            and not isinstance(cause, DescriptionError)
        ):
            break
        suffix = suffix or str(getattr(error, 'suffix', None) or '')
        error = cause
    if isinstance(error, RecursionError):
        return 'nested too deep'
    if isinstance(error, MemoryError):
        return 'needs too much memory'
    text = ' '.join(f'{error} {suffix}'.replace('(<expression>, line 1)', '').split())
    text = text or type(error).__name__
    return text if len(text) <= LONGEST_REASON else f'{text[:LONGEST_REASON]} ...'
