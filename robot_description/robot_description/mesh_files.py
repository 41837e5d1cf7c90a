# SPDX-License-Identifier: Apache-2.0
"""Mesh files in a folder, found by exact and by almost exact names."""

from collections.abc import Iterable
import filecmp
import os
from pathlib import Path
from pathlib import PurePosixPath

# Formats that can be read, the ones that say most about a mesh with least trouble first.
EXTENSIONS = ('.obj', '.stl', '.dae', '.glb', '.gltf', '.ply')
MOST_FILES = 50_000


def mesh_files(folder: Path) -> list[Path]:
    """Return the mesh files below a folder, sorted; links to folders are not followed."""
    found: list[Path] = []
    count = 0
    for place, folders, files in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith('.')]
        count += len(files)
        found += [path for name in files if _is_mesh(path := Path(place, name))]
        if count > MOST_FILES:
            break
    return sorted(found)


def in_any_case(folder: Path, relative: PurePosixPath) -> Path | None:
    """Return the only file at a relative path when upper and lower case do not count."""
    places = [folder]
    for part in relative.parts:
        places = [
            child
            for place in places
            for child in _children(place)
            if child.name.lower() == part.lower()
        ]
    return only([place for place in places if place.is_file()])


def with_other_extension(path: Path) -> Path | None:
    """Return the file of the same stem beside `path` in the format that is liked best."""
    beside = [
        child
        for child in _children(path.parent)
        if child.stem.lower() == path.stem.lower() and _is_mesh(child)
    ]
    return best_format(beside)


def best_format(paths: Iterable[Path]) -> Path | None:
    """Return the only file in the format that is liked best; None when there are several."""
    paths = list(paths)
    for extension in EXTENSIONS:
        of_format = [path for path in paths if path.suffix.lower() == extension]
        if of_format:
            return only(of_format)
    return None


def only(paths: list[Path]) -> Path | None:
    """Return the only file; copies of one file, as Unitree's clone has them, count as one."""
    if not paths or any(not _is_same(paths[0], other) for other in paths[1:]):
        return None
    return paths[0]


def closest(paths: Iterable[Path], wanted: PurePosixPath) -> list[Path]:
    """Return the files whose path ends most like the wanted one, folder by folder."""
    ends = {path: _common_end(path.parts[:-1], wanted.parts[:-1]) for path in paths}
    best = max(ends.values(), default=0)
    return [path for path, length in ends.items() if length == best]


def _is_mesh(path: Path) -> bool:
    """Whether a path is a file, not a link to nowhere, and its name ends as a mesh's does."""
    return path.name.lower().endswith(EXTENSIONS) and path.is_file()


def _common_end(one: tuple[str, ...], other: tuple[str, ...]) -> int:
    count = 0
    for a, b in zip(reversed(one), reversed(other), strict=False):
        if a.lower() != b.lower():
            break
        count += 1
    return count


def _children(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError:
        return []


def _is_same(one: Path, other: Path) -> bool:
    try:
        return filecmp.cmp(one, other, shallow=False)
    except OSError:
        return False
