# SPDX-License-Identifier: Apache-2.0
"""The files of a description while they are mended: changed in memory, byte by byte."""

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
import re
from typing import NamedTuple

from wasd_core.errors import DescriptionError, PackageNotFound
from wasd_core.safe_files import Place

from robot_description.lint.model import Model, to_element
from robot_description.lint.rules import Finding
from robot_description.lint.session import lint
from robot_description.meshes.opening import open_meshes
from robot_description.meshes.resolver import MeshReport, MeshResolver
from robot_description.packages import own_folder, PackageFinder
from robot_description.urdf import parse_urdf
from robot_description.xacro.session import Expansion, XacroSession
from robot_description.xacro.source import parse_source, SourceTag

FIND = re.compile(r'\$\(find\s+([^\s)]+)\s*\)')


class Edit(NamedTuple):
    """Bytes `start`..`end` of a file, and the text to stand there."""

    path: Path
    start: int
    end: int
    text: str


class Workspace:
    """
    A description's files as they are now; `changed` are those that are not as on the disk.

    Only files of the description's own package are changed.
    """

    def __init__(
        self, path: Path, arguments: Mapping[str, str], search: Sequence[Path] = ()
    ) -> None:
        self.path = path
        self.folder = own_folder(path)
        self.original: dict[Path, bytes] = {}
        self.changed: dict[Path, bytes] = {}
        self._arguments = arguments
        self._search = search
        self._parse = cache(parse_source)
        self._linted: tuple[dict[Path, bytes], list[Finding]] | None = None

    def model(self) -> Model:
        """
        Return what the files expand to now.

        Raises:
            DescriptionError: they do not.
        """
        return Model(to_element(self._expand()), self.path, self._search)

    def meshes(self) -> MeshReport:
        """
        Return what becomes of the meshes now.

        Raises:
            DescriptionError: the files do not expand, or to no robot.
        """
        robot = parse_urdf(self._expand().urdf)
        return open_meshes(robot, MeshResolver(robot, self.path, self._search).report())

    def with_folders(self, text: str) -> str:
        """Return a text with the folders that its `$(find)` mean."""
        finder = PackageFinder(self._search, self.path)
        try:
            return FIND.sub(lambda match: str(finder.find(match[1])), text)
        except PackageNotFound:
            return text

    def lint(self) -> list[Finding]:
        """Return what is wrong with the files as they are now; told from memory if unchanged."""
        if self._linted is not None and self._linted[0] == self.changed:
            return self._linted[1]
        session = self._session()
        found = lint(session)
        self._remember(session)
        self._linted = dict(self.changed), found
        return found

    def texts(self) -> dict[Path, bytes]:
        """Return the files that were read so far."""
        return {**self.original, **self.changed}

    def sources(self) -> dict[Path, bytes]:
        """Return those of them that may be changed."""
        return {path: data for path, data in self.texts().items() if self._is_own(path)}

    def tags(self, path: Path) -> SourceTag:
        """Return a file's elements with their places in its bytes."""
        return self._parse(self.sources()[path])

    def tag_at(self, place: Place, name: str) -> SourceTag | None:
        """Return the element of a name that begins at a place, in any of our files."""
        if place.file not in self.sources():
            return None
        for tag in self.tags(place.file).walk():
            if (tag.line, tag.column, tag.name) == (place.line, place.column, name):
                return tag
        return None

    def apply(self, edits: Iterable[Edit]) -> None:
        """Change the files, the last place first; what overlaps is done once."""
        ordered = sorted(set(edits), key=lambda edit: edit.start, reverse=True)
        sources = self.sources()
        for edit in ordered:
            data = self.changed.get(edit.path, sources[edit.path])
            text = edit.text.encode()
            self.changed[edit.path] = data[: edit.start] + text + data[edit.end :]

    def _expand(self) -> Expansion:
        session = self._session()
        try:
            return session.expand()
        finally:
            self._remember(session)

    def _session(self) -> XacroSession:
        return XacroSession(self.path, self._arguments, self._search, self.changed)

    def _remember(self, session: XacroSession) -> None:
        for path, data in session.sources.items():
            if path not in self.changed and self.original.setdefault(path, data) != data:
                raise DescriptionError(f'{path}: changed while it was being mended')
            try:
                if self._is_own(path):
                    data.decode()
            except UnicodeDecodeError:
                raise DescriptionError(f'{path}: is not UTF-8, so it cannot be mended') from None

    def _is_own(self, path: Path) -> bool:
        return path.resolve().is_relative_to(self.folder.resolve())
