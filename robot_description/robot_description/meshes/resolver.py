# SPDX-License-Identifier: Apache-2.0
"""From the mesh URLs of a description to files, by rules; it only ever reads."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from dataclasses import dataclass
from functools import cache
import os
from pathlib import Path
from pathlib import PurePosixPath
from typing import Any, NamedTuple

from wasd_core.errors import DescriptionError

from robot_description.meshes.files import best_format
from robot_description.meshes.files import closest
from robot_description.meshes.files import guess_files
from robot_description.meshes.files import in_any_case
from robot_description.meshes.files import mesh_files
from robot_description.meshes.files import MeshUrl
from robot_description.meshes.files import only
from robot_description.meshes.files import read_url
from robot_description.meshes.files import with_other_extension
from robot_description.packages import AllowedPaths
from robot_description.packages import dependencies
from robot_description.packages import manifest_name
from robot_description.packages import own_folder
from robot_description.packages import own_package
from robot_description.packages import OWN_PACKAGES
from robot_description.robot import Robot

EXACT = 'exact'
MISSING = 'missing'
AMBIGUOUS = 'ambiguous'
# What was done to find a file, in words; several may come together, joined by '+'.
REPAIRS = {
    'own-package': 'its package is unknown, found in that of the description',
    'foreign-package': 'belongs to another robot: package.xml does not name that package',
    're-rooted': 'that path is of another machine, found in the package of the description',
    'package-root': 'not relative to the description, found relative to its package',
    'find-left': '$(find) was left in the text',
    'percent-escape': 'percent signs were meant as escapes',
    'case': 'upper and lower case differ',
    'extension': 'another file format is there',
    'moved': 'found in another folder of the package',
    'near-name': 'the only mesh not used otherwise whose name fits',
}
# Where absolute paths begin.
ROOT = Path('/')


@dataclass(frozen=True)
class MeshRecord:
    """
    One mesh URL as one link uses it, and what came of it.

    `use` is `visual` or `collision`; `kind` is `exact`, `missing`, `ambiguous` or names of
    REPAIRS joined by `+`; `candidates` are the files among which could not be decided.
    """

    url: str
    link: str
    use: str
    kind: str
    file: Path | None = None
    candidates: tuple[Path, ...] = ()

    @property
    def is_exact(self) -> bool:
        """Whether the file is where the URL says."""
        return self.kind == EXACT

    def line(self) -> str:
        """Return what happened in one line."""
        what = f'{self.use} mesh {self.url!r} of link {self.link!r}'
        if self.file is not None:
            reasons = '; '.join(REPAIRS[kind] for kind in self.kind.split('+') if kind in REPAIRS)
            return f'{what}: {self.kind}: using {self.file} ({reasons})'
        listed = ', '.join(str(path) for path in self.candidates) or 'none'
        shown = 'left out' if self.use == 'visual' else 'cannot be left out'
        return f'{what}: {self.kind}, {shown}; candidates: {listed}'

    def record(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        file = str(self.file) if self.file is not None else None
        return asdict(self) | {'file': file, 'candidates': [str(c) for c in self.candidates]}


@dataclass(frozen=True)
class MeshReport:
    """All mesh URLs of a description, each with its uses."""

    records: tuple[MeshRecord, ...] = ()

    @property
    def repairs(self) -> tuple[MeshRecord, ...]:
        """What was not exact, each URL once."""
        seen: dict[str, MeshRecord] = {}
        for record in self.records:
            if not record.is_exact:
                seen.setdefault(record.url, record)
        return tuple(seen.values())

    @property
    def files(self) -> dict[str, Path]:
        """The files that were found, by URL."""
        return {record.url: record.file for record in self.records if record.file is not None}

    def check(self, strict: bool = False) -> None:
        """
        Refuse what cannot be simulated, and with `strict` whatever is not exact.

        Raises:
            DescriptionError: the first mesh in question, and how many more there are.
        """
        wrong = [
            record
            for record in self.records
            if record.file is None and record.use == 'collision' or strict and not record.is_exact
        ]
        if wrong:
            rest = len({record.url for record in wrong}) - 1
            more = f' (and {rest} more)' if rest else ''
            raise DescriptionError(f'{"--strict: " if strict else ""}{wrong[0].line()}{more}')


class MeshPlace(NamedTuple):
    """A folder and a path in it where a mesh may be; `kinds` are the repairs so far."""

    folder: Path
    path: PurePosixPath
    kinds: tuple[str, ...] = ()

    @property
    def file(self) -> Path:
        """The two joined; `..` is taken out by name, so that it cannot climb through links."""
        return Path(os.path.normpath(self.folder / self.path))


class Found(NamedTuple):
    """What a search came to: a file, or files among which it cannot decide."""

    kinds: tuple[str, ...]
    file: Path | None
    candidates: tuple[Path, ...] = ()


def resolve_meshes(robot: Robot, description: Path, search: Sequence[Path] = ()) -> MeshReport:
    """
    Find the files of all meshes of a robot.

    `description` is the file it was read from, `search` are folders the user gave.

    Raises:
        DescriptionError: a URL leads out of the folders that a description may use.
    """
    return MeshResolver(robot, description, search).report()


class MeshResolver:
    """
    Finds mesh files for one description.

    Tried in this order: the file as named in any folder it may mean; other upper and lower case;
    another format of the same name; a unique file of the name elsewhere in the package; and when
    all others are known, the only unused one whose name is near.
    """

    def __init__(self, robot: Robot, description: Path, search: Sequence[Path] = ()) -> None:
        self._robot = robot
        self._folder = description.absolute().parent
        self._own = own_folder(description)
        self._package = own_package(description)
        self._allowed = AllowedPaths(description, search)
        self._finder = self._allowed.finder
        self._files = cache(mesh_files)
        self._trunk = {link for link, carrier in robot.carriers.items() if carrier == robot.root}

    def report(self) -> MeshReport:
        """Return what became of every mesh of every link."""
        uses = [
            (shape.url, link.name, use)
            for link in self._robot.links.values()
            for use, shapes in (('visual', link.visuals), ('collision', link.collisions))
            for shape in shapes
            if shape.kind == 'mesh'
        ]
        links = {url: link for url, link, _ in reversed(uses)}
        found = {url: self._resolve(url, links[url]) for url in links}
        used = {one.file for one in found.values() if one.file is not None}
        for url, one in found.items():
            if one.file is None and not one.candidates:
                found[url] = self._guess(url, links[url], used)
        for url, one in found.items():
            if one.file is not None and not self._allowed.has(one.file):
                raise self._refusal(url, links[url])
        return MeshReport(
            tuple(self._record(url, link, use, found[url]) for url, link, use in uses)
        )

    def _record(self, url: str, link: str, use: str, found: Found) -> MeshRecord:
        if found.file is not None:
            kind = '+'.join(found.kinds) or EXACT
        else:
            kind = AMBIGUOUS if found.candidates else MISSING
        return MeshRecord(url, link, use, kind, found.file, found.candidates)

    def _resolve(self, url: str, link: str) -> Found:
        places = [place for reading in read_url(url) for place in self._places(reading)]
        inside = [place for place in places if self._may_use(place)]
        for place in inside:
            if place.file.is_file():
                return Found(place.kinds, place.file)
        for place in inside:
            if (same := in_any_case(place.folder, place.path)) is not None:
                return Found((*place.kinds, 'case'), same)
        for place in inside:
            if (other := with_other_extension(place.file)) is not None:
                return Found((*place.kinds, 'extension'), other)
        for place in inside:
            if place.folder != ROOT and (found := self._moved(place)) is not None:
                return found
        # An absolute path that is not there is one of another machine, and leads nowhere here.
        outside = [place for place in places if place not in inside]
        if any(place.folder != ROOT or place.file.is_file() for place in outside):
            raise self._refusal(url, link)
        return Found((), None)

    def _refusal(self, url: str, link: str) -> DescriptionError:
        return DescriptionError(
            f'link {link!r}: mesh {url!r} leads out of {self._own} and of the packages it names; '
            '--package-path DIR allows a folder'
        )

    def _places(self, url: MeshUrl) -> Iterator[MeshPlace]:
        """Yield where the file of a URL may be, the likelier place first."""
        if url.package is not None:
            yield from self._in_package(url.package, url.path, url.kinds)
        elif url.path.is_absolute():
            yield MeshPlace(ROOT, url.path.relative_to('/'), url.kinds)
            yield from self._in_share(url)
            yield from self._re_rooted(url)
        else:
            yield MeshPlace(self._folder, url.path, url.kinds)
            tail = PurePosixPath(*(part for part in url.path.parts if part != '..'))
            for folder in (self._own, self._own / 'meshes'):
                yield MeshPlace(folder, tail, (*url.kinds, 'package-root'))

    def _in_package(
        self, package: str, path: PurePosixPath, kinds: tuple[str, ...]
    ) -> Iterator[MeshPlace]:
        known = False
        for folder in self._finder.folders(package):
            known = True
            self._allowed.add(folder)
            foreign = ('foreign-package',) if self._is_foreign(package, folder) else ()
            yield MeshPlace(folder, path, (*kinds, *foreign))
        if not known:
            yield MeshPlace(self._own, path, (*kinds, 'own-package'))

    def _in_share(self, url: MeshUrl) -> Iterator[MeshPlace]:
        """Yield an absolute path's part below a package's share folder, as we publish such."""
        parts = url.path.parts
        for index in (i for i, part in enumerate(parts[:-2]) if part == 'share'):
            tail = PurePosixPath(*parts[index + 2 :])
            for place in self._in_package(parts[index + 1], tail, url.kinds):
                is_same = place.file == Path(url.path)
                if place.folder != self._own:
                    yield place if is_same else place._replace(kinds=(*url.kinds, 're-rooted'))

    def _re_rooted(self, url: MeshUrl) -> Iterator[MeshPlace]:
        """Yield an absolute path's tails below the description's package, the longest first."""
        kinds = (*url.kinds, 're-rooted')
        parts = url.path.parts[1:]
        for index in range(1, len(parts)):
            yield MeshPlace(self._own, PurePosixPath(*parts[index:]), kinds)

    def _is_foreign(self, package: str, folder: Path) -> bool:
        """Whether a package is another robot's that the description's own does not ask for."""
        if self._package is None or folder == self._package or folder in self._finder.search:
            return False
        own = manifest_name(self._package)
        if own in (None, package) or own in OWN_PACKAGES:
            return False
        return package not in dependencies(self._package)

    def _may_use(self, place: MeshPlace) -> bool:
        """Whether a place is in a folder that the user, the description or a package names."""
        roots = [self._own, *self._finder.search]
        if place.folder not in (ROOT, self._folder):
            roots.append(place.folder)
        if any(place.file.is_relative_to(root) for root in roots):
            return True
        package = own_package(place.file)
        name = manifest_name(package) if package is not None else None
        if package is None or name is None or package not in set(self._finder.folders(name)):
            return False
        self._allowed.add(package)
        return True

    def _moved(self, place: MeshPlace) -> Found | None:
        """Look for the file's name anywhere in the folder's package."""
        root = self._own if place.folder == self._folder else place.folder
        name = place.path.name
        everywhere = self._files(root)
        matches = [path for path in everywhere if path.name == name]
        kinds = (*place.kinds, 'moved')
        if not matches:
            kinds = (*kinds, 'case')
            matches = [path for path in everywhere if path.name.lower() == name.lower()]
        if matches:
            return _decided(kinds, closest(matches, place.path))
        stem = place.path.stem.lower()
        alike = closest((path for path in everywhere if path.stem.lower() == stem), place.path)
        best = best_format(alike)
        if best is not None:
            return Found((*place.kinds, 'moved', 'extension'), best)
        return Found((), None, tuple(alike)) if alike else None

    def _guess(self, url: str, link: str, used: set[Path]) -> Found:
        """Choose among the meshes that nothing else uses, when only one has a name that fits."""
        for reading in read_url(url):
            for place in self._places(reading):
                if not self._may_use(place) or place.folder == ROOT:
                    continue
                root = place.file.parent
                if not place.path.parent.parts or not root.is_dir():
                    root = self._own if place.folder == self._folder else place.folder
                stems = {path.stem for path in used if path.is_relative_to(root)}
                unused = [path for path in self._files(root) if path.stem not in stems]
                near = guess_files(place.path.stem, unused, link in self._trunk)
                best = best_format(near)
                if best is not None and len({path.stem for path in near}) == 1:
                    return Found((*place.kinds, 'near-name'), best)
                return Found((), None, near)
        return Found((), None)


def _decided(kinds: tuple[str, ...], matches: list[Path]) -> Found:
    file = only(matches)
    return Found(kinds, file) if file is not None else Found((), None, tuple(matches))
