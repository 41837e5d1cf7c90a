# SPDX-License-Identifier: Apache-2.0
"""What a mesh URL means, where its file may be, and how it is best called: own package first."""

from collections.abc import Iterable, Iterator, Sequence
import os
from pathlib import Path, PurePosixPath
import re
from typing import NamedTuple
from urllib.parse import unquote

from robot_description.packages import (
    AllowedPaths,
    dependencies,
    installed_folders,
    linked,
    manifest_name,
    own_folder,
    OWN_PACKAGE,
    own_package,
    package_url,
)

# Of a file's name, and of a path with room for the folders before it.
LONGEST_NAME, LONGEST_PATH = 255, 3000
# Where absolute paths begin.
ROOT = Path('/')
# Ranks of a place. What the user gave, what is around the description, and its own package:
NEAR = 0
# An installed package of another name, where a file may be just as the URL says:
OTHER = 1
# An installed package of the own one's name:
NAMESAKE = 2


class MeshUrl(NamedTuple):
    """
    A URL taken apart.

    `package` is its package, None for a plain path; `path` is relative to the package, absolute,
    or relative to the description; `kinds` are the repairs that reading it took.
    """

    package: str | None
    path: PurePosixPath
    kinds: tuple[str, ...] = ()


def read_url(url: str) -> list[MeshUrl]:
    """
    Return what a URL may mean, the likelier reading first; nothing when it is no local file.

    A percent escape is tried as it stands, then decoded; a backslash then as a slash.
    """
    plain = _read(url.strip())
    if plain is None or plain.path == PurePosixPath('.') or _is_no_name(plain.path):
        return []
    readings = [plain]
    for kind, path in (
        ('percent-escape', unquote(str(plain.path))),
        ('backslash', str(plain.path).replace('\\', '/')),
    ):
        if path != str(plain.path) and not _is_no_name(PurePosixPath(path)):
            meant = plain._replace(path=PurePosixPath(path), kinds=(*plain.kinds, kind))
            readings.append(meant)
    return readings


def _is_no_name(path: PurePosixPath) -> bool:
    """Whether a path is such that no file can be called so."""
    longest = max((len(os.fsencode(part)) for part in path.parts), default=0)
    return '\0' in str(path) or longest > LONGEST_NAME or len(str(path)) > LONGEST_PATH


def _read(url: str) -> MeshUrl | None:
    url = re.sub('^file:(?!//)', 'file://', url, flags=re.IGNORECASE)  # as RFC 8089 allows
    if left := re.fullmatch(r'\$\(find\s+([^\s)]+)\s*\)/*(.*)', url.removeprefix('file://')):
        return MeshUrl(left[1], PurePosixPath(left[2]), ('find-left',))
    scheme, colon, rest = url.partition('://')
    rest = re.sub('/{2,}', '/', rest)
    if not colon:
        return MeshUrl(None, PurePosixPath(re.sub('/{2,}', '/', url)))
    if scheme.lower() == 'file':
        return MeshUrl(None, PurePosixPath(rest))
    if scheme.lower() in ('package', 'model'):
        package, _, path = rest.lstrip('/').partition('/')
        return MeshUrl(unquote(package), PurePosixPath(path))
    return None


class MeshPlace(NamedTuple):
    """
    A folder and a path in it where a mesh may be.

    `kinds` are the repairs so far; `root` is the package that the folder is or lies in.
    """

    folder: Path
    path: PurePosixPath
    kinds: tuple[str, ...]
    root: Path
    rank: int = NEAR

    @property
    def file(self) -> Path:
        """The two joined; `..` is taken out by name, so that it cannot climb through links."""
        return Path(os.path.normpath(self.folder / self.path))


class MeshPlaces:
    """The places in which the meshes of one description may be; `urls` are all it names."""

    def __init__(self, description: Path, search: Sequence[Path], urls: Iterable[str]) -> None:
        # Where relative paths begin, and the package there; a link has its target's as well.
        self._homes = {path.parent: own_folder(path) for path in linked(description)}
        self.own = own_folder(description)
        self.allowed = AllowedPaths(description, search)
        self._package = own_package(description)
        self._finder = self.allowed.finder
        self._dependencies = dependencies(self._package) if self._package is not None else set()
        # Nothing is special about what is installed to a description that is, too.
        self._installed = [f for f in installed_folders() if not self.own.is_relative_to(f)]
        readings = [reading for url in urls for reading in read_url(url)[:1]]
        # Whether the folder was renamed: then no URL goes by its name.
        self._is_renamed = not any(self._is_own(reading) for reading in readings)
        # The packages that the folder is a copy of, and where in them it was.
        self._copied = dict(filter(None, map(self._copied_from, readings)))

    def of(self, url: str) -> tuple[list[MeshPlace], bool]:
        """Return the places for a URL, the likelier first, and whether it leads out of bounds."""
        places = [place for reading in read_url(url) for place in self._places(reading)]
        inside = [place for place in places if self._may_use(place)]
        # An absolute path that is not there is one of another machine, and leads nowhere here.
        return inside, any(
            place.folder != ROOT or os.path.isfile(place.file)
            for place in places
            if place not in inside
        )

    def better_url(self, url: str, file: Path, is_exact: bool) -> str | None:
        """
        Return what to write for a file, so that other programs find it on other machines, too.

        None where the URL is as good, and for a file of a package that just happens to be
        installed here.
        """
        reading = read_url(url)[0]
        is_plain = reading.package is None and not reading.path.is_absolute()
        if is_exact and (is_plain or reading.package is not None):
            return None
        named = package_url(file)
        for folder, own in self._homes.items():
            if file.is_relative_to(own):
                relative = Path(os.path.relpath(file, folder)).as_posix()
                return relative if is_plain or named is None else named
        package = own_package(file)
        name = manifest_name(package) if package is not None else None
        is_portable = name in self._dependencies or not self._is_installed(file)
        return named if is_portable and not is_exact else None

    def _is_own(self, url: MeshUrl) -> bool:
        if url.package is None:
            return not url.path.is_absolute()
        return bool(self._finder.own_named(url.package))

    def _copied_from(self, url: MeshUrl) -> tuple[str, tuple[str, ...]] | None:
        """Return the other package that a URL names, and the folder in it that the own one has."""
        if url.package is None or self._is_own(url) or url.package in self._dependencies:
            return None
        parts = url.path.parts
        names = {name for own in self._finder.own for name in (own.name, manifest_name(own))}
        for count in range(len(parts) - 1):
            is_named = self._is_renamed or count and parts[count - 1] in names
            tail = Path(*parts[count:])
            if is_named and any(os.path.isfile(own / tail) for own in self._finder.own):
                return url.package, parts[:count]
        return None

    def _is_installed(self, path: Path) -> bool:
        return any(path.is_relative_to(folder) for folder in self._installed)

    def _places(self, url: MeshUrl) -> Iterator[MeshPlace]:
        if url.package is not None:
            yield from self._in_package(url, url.package)
        elif url.path.is_absolute():
            yield MeshPlace(ROOT, url.path.relative_to('/'), url.kinds, ROOT)
            yield from self._in_share(url)
            yield from self._re_rooted(url)
        else:
            for folder, own in self._homes.items():
                yield MeshPlace(folder, url.path, url.kinds, own)
            tail = PurePosixPath(*(part for part in url.path.parts if part != '..'))
            for folder in (self.own, self.own / 'meshes'):
                yield MeshPlace(folder, tail, (*url.kinds, 'package-root'), folder)

    def _in_package(self, url: MeshUrl, package: str) -> Iterator[MeshPlace]:
        """Yield the folders of a package; the own one's, too, unless it asks for the other."""
        prefix = self._copied.get(package)
        is_own = self._is_own(url) or prefix is not None
        given, others = [], []
        for folder in self._finder.folders(package):
            self.allowed.add(folder)
            kinds = (*url.kinds, 'foreign-package') if self._is_foreign(package) else url.kinds
            place = MeshPlace(folder, url.path, kinds, folder)
            if folder in self._finder.own or self._is_given(folder):
                given.append(place._replace(kinds=url.kinds))
            elif is_own:
                others.append(place._replace(rank=NAMESAKE))
            else:
                others.append(place._replace(rank=OTHER if self._is_installed(folder) else NEAR))
        mine, path = [], url.path
        if prefix is not None and path.parts[: len(prefix)] == prefix:
            path = PurePosixPath(*path.parts[len(prefix) :])
        if (
            prefix is not None
            or not is_own
            and not (given + others and package in self._dependencies)
        ):
            kinds = (*url.kinds, 'own-package')
            mine = [MeshPlace(own, path, kinds, own) for own in self._finder.own]
        yield from given
        yield from (*mine, *others) if self._is_renamed or is_own else (*others, *mine)

    def _in_share(self, url: MeshUrl) -> Iterator[MeshPlace]:
        """Yield an absolute path's part below a package's share folder, as we publish such."""
        parts = url.path.parts
        for index in (i for i, part in enumerate(parts[:-2]) if part == 'share'):
            tail = MeshUrl(parts[index + 1], PurePosixPath(*parts[index + 2 :]), url.kinds)
            for place in self._in_package(tail, parts[index + 1]):
                if place.file == Path(url.path):
                    yield place._replace(rank=NEAR)
                elif place.folder not in self._finder.own:
                    yield place._replace(kinds=(*url.kinds, 're-rooted'))

    def _re_rooted(self, url: MeshUrl) -> Iterator[MeshPlace]:
        """Yield an absolute path's tails below the description's package, the longest first."""
        kinds = (*url.kinds, 're-rooted')
        parts = url.path.parts[1:]
        for index in range(1, len(parts)):
            for own in self._finder.own:
                yield MeshPlace(own, PurePosixPath(*parts[index:]), kinds, own)

    def _is_foreign(self, package: str) -> bool:
        """Whether a package is another robot's that the description's own does not ask for."""
        own = manifest_name(self._package) if self._package is not None else None
        if own in (None, package, OWN_PACKAGE):
            return False
        return package not in self._dependencies

    def _is_given(self, folder: Path) -> bool:
        return any(folder.is_relative_to(given) for given in self._finder.search)

    def _may_use(self, place: MeshPlace) -> bool:
        """Whether a place is in a folder that the user, the description or a package names."""
        roots = [*self._finder.own, *self._finder.search]
        if place.folder != ROOT and place.folder not in self._homes:
            roots.append(place.folder)
        if any(place.file.is_relative_to(root) for root in roots):
            return True
        package = own_package(place.file)
        name = manifest_name(package) if package is not None else None
        if package is None or name is None or package not in set(self._finder.folders(name)):
            return False
        self.allowed.add(package)
        return True
