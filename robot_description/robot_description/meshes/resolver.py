# SPDX-License-Identifier: Apache-2.0
"""From the mesh URLs of a description to files, by rules; it only ever reads."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
import os
from pathlib import Path
from typing import Any, NamedTuple

from wasd_core.errors import DescriptionError

from robot_description.meshes.files import (
    best_format,
    closest,
    guess_files,
    in_any_case,
    is_carrier,
    mesh_files,
    only,
    part_words,
    PARTS,
    with_other_extension,
)
from robot_description.meshes.places import MeshPlace, MeshPlaces, NAMESAKE, NEAR, ROOT
from robot_description.robot import Robot, Shape

EXACT = 'exact'
MISSING = 'missing'
AMBIGUOUS = 'ambiguous'
UNUSABLE = 'unusable'
SIZE = 'size'
# What was done to find a file, in words; several may come together, joined by '+'.
REPAIRS = {
    'own-package': "from the description's package, not from the one in the path",
    'namesake': 'of another package of that name',
    'foreign-package': 'belongs to another robot: package.xml does not name that package',
    're-rooted': "a path of another machine, found in the description's package",
    'package-root': 'not relative to the description, found relative to its package',
    'find-left': '$(find) was left in the text',
    'percent-escape': 'percent signs are escapes',
    'backslash': 'backslashes are slashes',
    'case': 'upper and lower case differ',
    'extension': 'found in another file format',
    'moved': 'found in another folder of the package',
    'near-name': 'the only unused mesh with a matching name',
}

ON_THE_WEB = 'nothing is downloaded: save it beside the description, and write its path'
# Of these repairs the file may be another one than was meant.
GUESSED = {'namesake', 'extension', 'moved', 'near-name'}


@dataclass(frozen=True)
class MeshRecord:
    """
    One mesh URL as one link uses it, and what came of it.

    `use` is `visual` or `collision`; `kind` is `exact`, `missing`, `ambiguous`, `unusable`, or
    names of REPAIRS and `size` joined by `+`; `candidates` are the files among which could not be
    decided. `note` says what is wrong with the file itself, `instead` what becomes of the link
    without it. `better` is what to write, so that the file is found by other programs and on other
    machines, too.
    """

    url: str
    link: str
    use: str
    kind: str
    file: Path | None = None
    candidates: tuple[Path, ...] = ()
    note: str = ''
    instead: str = 'left out'
    better: str | None = None

    @property
    def is_exact(self) -> bool:
        """Whether the file is where the URL says."""
        return self.kind == EXACT

    def line(self) -> str:
        """Return what happened in one line."""
        what = f'{self.use} mesh {self.url!r} of link {self.link!r}: {self.kind}'
        if self.file is not None:
            reasons = [REPAIRS[kind] for kind in self.kind.split('+') if kind in REPAIRS]
            why = '; '.join([*reasons, *[self.note] * bool(self.note)])
            return f'{what}: using {self.file} ({why})'
        if self.kind == UNUSABLE:
            return f'{what}, {self.instead}: {self.note}'
        listed = ', '.join(str(path) for path in self.candidates) or 'none'
        why = f' ({self.note})' * bool(self.note)
        return f'{what}, {self.instead}; candidates: {listed}{why}'

    def record(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        return {
            'url': self.url,
            'link': self.link,
            'use': self.use,
            'kind': self.kind,
            'file': str(self.file) if self.file is not None else None,
            'candidates': [str(path) for path in self.candidates],
            'note': self.note,
        }


@dataclass(frozen=True)
class MeshReport:
    """All mesh URLs of a description, each with its uses."""

    records: tuple[MeshRecord, ...] = ()

    @cached_property
    def repairs(self) -> tuple[MeshRecord, ...]:
        """What was not exact, each thing that is to be said of a URL once."""
        seen: dict[tuple[str, ...], MeshRecord] = {}
        for record in self.records:
            if not record.is_exact:
                lost = () if record.file is not None else (record.use, record.instead)
                seen.setdefault((record.url, record.kind, record.note, *lost), record)
        return tuple(seen.values())

    @cached_property
    def files(self) -> dict[str, Path]:
        """The files that were found, by URL."""
        return {record.url: record.file for record in self.records if record.file is not None}

    def is_usable(self, shape: Shape) -> bool:
        """Whether a shape is no mesh, or one that was found and has something in it."""
        return shape.kind != 'mesh' or shape.url in self.files and all(shape.scale)


class Found(NamedTuple):
    """What a search came to: a file, or files among which it cannot decide."""

    kinds: tuple[str, ...] = ()
    file: Path | None = None
    candidates: tuple[Path, ...] = ()

    @property
    def is_open(self) -> bool:
        """Whether nothing was found, not even what cannot be decided between."""
        return self.file is None and not self.candidates


def mesh_shapes(robot: Robot) -> list[tuple[Shape, str]]:
    """Return the meshes of a robot with their links, as a report has their records."""
    return [
        (shape, link.name)
        for link in robot.links.values()
        for shape in (*link.visuals, *link.collisions)
        if shape.kind == 'mesh'
    ]


class MeshResolver:
    """
    Finds the mesh files of a robot; they are not opened yet.

    `description` is the file it was read from, `search` are folders the user gave.

    Tried in this order: the file as named in any folder it may mean; other upper and lower case;
    another format of the same name; a unique file of the name elsewhere in the package; and when
    all others are known, the only unused one whose name is near. All of that is tried with what is
    around the description before it is tried with what happens to be installed.
    """

    def __init__(self, robot: Robot, description: Path, search: Sequence[Path] = ()) -> None:
        self._shapes = mesh_shapes(robot)
        self._links = {shape.url: link for shape, link in reversed(self._shapes)}
        self._places = MeshPlaces(description, search, self._links)
        self._files = cache(mesh_files)
        self._trunk = {link for link, carrier in robot.carriers.items() if carrier == robot.root}

    def report(self) -> MeshReport:
        """
        Return what became of every mesh of every link.

        Raises:
            DescriptionError: a URL leads out of the folders that a description may use.
        """
        places, found = {}, {}
        for url in self._links:
            places[url], leads_out = self._places.of(url)
            found[url] = self._resolve(url, places[url], is_near=True)
            if leads_out and found[url].is_open:
                found[url] = self._resolve(url, places[url], is_near=False)
                if found[url].is_open:
                    raise self._refusal(url)
        for is_near in (True, False):
            for url in self._links:
                if found[url].is_open:
                    found[url] = self._resolve(url, places[url], is_near)
            used = {one.file for one in found.values() if one.file is not None}
            for url in self._links:
                if found[url].is_open:
                    found[url] = self._guess(url, places[url], is_near, used)
        for url, one in found.items():
            if one.file is not None and not self._places.allowed.has(one.file):
                raise self._refusal(url)
        return MeshReport(
            tuple(self._record(shape, link, found[shape.url]) for shape, link in self._shapes)
        )

    def _record(self, shape: Shape, link: str, found: Found) -> MeshRecord:
        if found.file is not None:
            kind = '+'.join(found.kinds) or EXACT
            better = self._places.better_url(shape.url, found.file, kind == EXACT)
        else:
            kind, better = AMBIGUOUS if found.candidates else MISSING, None
        use = 'collision' if shape.collides else 'visual'
        note = ON_THE_WEB if shape.url.lower().startswith(('http://', 'https://')) else ''
        return MeshRecord(
            shape.url, link, use, kind, found.file, found.candidates, note, better=better
        )

    def _refusal(self, url: str) -> DescriptionError:
        return DescriptionError(
            f'link {self._links[url]!r}: mesh {url!r} leads out of {self._places.own} and of the '
            'packages it names; --package-path DIR allows a folder'
        )

    def _resolve(self, url: str, places: list[MeshPlace], is_near: bool) -> Found:
        for place in places:
            if (place.rank < NAMESAKE) == is_near and os.path.isfile(place.file):
                return Found(place.kinds, place.file)
        places = _to_repair(places, is_near)
        for place in places:
            if (same := in_any_case(place.folder, place.path)) is not None:
                return Found((*place.kinds, 'case'), same)
        for place in places:
            if (other := with_other_extension(place.file)) is not None:
                return Found((*place.kinds, 'extension'), other)
        for place in places:
            if place.folder != ROOT and not (found := self._moved(url, place)).is_open:
                return found
        return Found()

    def _moved(self, url: str, place: MeshPlace) -> Found:
        """Look for the file's name anywhere in the folder's package."""
        name = place.path.name
        everywhere = self._files(place.root)
        matches = [path for path in everywhere if path.name == name]
        kinds = (*place.kinds, 'moved')
        if not matches:
            kinds = (*kinds, 'case')
            matches = [path for path in everywhere if path.name.lower() == name.lower()]
        if not matches:
            stem = place.path.stem.lower()
            alike = closest((path for path in everywhere if path.stem.lower() == stem), place.path)
            kinds = (*place.kinds, 'moved', 'extension')
            matches = [best] if (best := best_format(alike)) is not None else alike
        if self._links[url] in self._trunk and is_carrier(place.path.stem):
            matches = [path for path in matches if not self._words(path, place) & PARTS]
        alike = closest(matches, place.path)
        file = only(alike)
        return Found(kinds, file) if file is not None else Found((), None, tuple(alike))

    def _guess(self, url: str, places: list[MeshPlace], is_near: bool, used: set[Path]) -> Found:
        """Choose among the meshes that nothing else uses, when only one has a name that fits."""
        for place in _to_repair(places, is_near):
            folders = [place.file.parent] if place.path.parent.parts else []
            for folder in (*folders, place.root) if place.folder != ROOT else ():
                stems = {path.stem for path in used if path.is_relative_to(folder)}
                unused = [path for path in self._files(folder) if path.stem not in stems]
                near = guess_files(place.path.stem, unused, self._links[url] in self._trunk)
                whole = [path for path in near if not self._words(path, place)]
                best = best_format(whole)
                if best is not None and len({path.stem for path in whole}) == 1:
                    moved = () if best.parent == place.file.parent else ('moved',)
                    return Found((*place.kinds, *moved, 'near-name'), best)
                if near:
                    return Found((), None, tuple(whole or near))
        return Found()

    def _words(self, file: Path, place: MeshPlace) -> set[str]:
        return part_words(file, place.root, place.path)


def _to_repair(places: list[MeshPlace], is_near: bool) -> list[MeshPlace]:
    """Return the places where what is not quite the file may be, near the description or not."""
    chosen = [place for place in places if (place.rank == NEAR) == is_near]
    return [
        place._replace(kinds=(*place.kinds, 'namesake')) if place.rank == NAMESAKE else place
        for place in chosen
    ]
