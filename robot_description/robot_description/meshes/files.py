# SPDX-License-Identifier: Apache-2.0
"""Names of mesh files: which file was meant, and where RViz finds it."""

from collections.abc import Collection, Iterable, Mapping
import difflib
import filecmp
import os
from pathlib import Path, PurePosixPath
import re
from urllib.parse import unquote
import xml.etree.ElementTree as ElementTree

from robot_description.morphology.names import SIDES, words
from robot_description.packages import PACKAGE

# Formats that can be read, the ones that say most about a mesh with least trouble first.
EXTENSIONS = ('.obj', '.stl', '.dae', '.glb', '.gltf', '.ply')
MOST_FILES = 50_000
# Words for the part that carries the legs or wheels; robots are rebuilt, references stay.
ALIASES = {'trunk': 'base', 'body': 'base', 'base_link': 'base', 'base': 'base'}
# Words beside SIDES that tell parts of one robot apart however alike their names are.
MARKS = {'upper', 'lower', 'mirror', 'inner', 'outer', 'top', 'bottom', 'bl', 'br', 'lr', 'l', 'r'}
# difflib's ratio; thigh and thighs have 0.91, calf and calf_mirror 0.53, thigh and shank 0.2.
LEAST_LIKENESS = 0.75
# Words that any name may have: they make no two names alike.
WEAK = {'link', 'joint', 'mesh', 'visual', 'collision', 'part', 'model'}
# Words for folders that hold the meshes of a whole robot.
WHOLE = {
    *('mesh', 'meshes', 'visual', 'visuals', 'collision', 'collisions', 'model', 'models', 'cad'),
    *('geometry', 'geometries', 'asset', 'assets', 'media', 'resource', 'resources', 'robot'),
    *('robots', 'description', 'data', 'urdf', 'high', 'low'),
    *(extension.removeprefix('.') for extension in EXTENSIONS),
}  # fmt: skip
# Words for a folder with the meshes of a part that may have a base of its own.
PARTS = {
    *('arm', 'arms', 'gripper', 'grippers', 'hand', 'hands', 'finger', 'leg', 'legs', 'wheel'),
    *('wheels', 'head', 'camera', 'cameras', 'sensor', 'sensors', 'lidar', 'lidars', 'payload'),
}
# A mesh with the URL in it; comments and what is no mesh stay as they are.
MESH = re.compile(r"""<!--.*?-->|(<mesh\b[^<>]*?\bfilename\s*=\s*)("[^"]*"|'[^']*')""", re.DOTALL)


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
    return only([place for place in places if os.path.isfile(place)])


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
    return path.name.lower().endswith(EXTENSIONS) and os.path.isfile(path)


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


def guess_files(missing: str, unused: Collection[Path], carries: bool) -> tuple[Path, ...]:
    """
    Return the files among `unused` that a missing stem may mean: one is an answer.

    `carries` says that the link is the root or welded to it; then aliases of it count first.
    """
    if carries:
        wanted = _without_alias(missing)
        aliases = [path for path in unused if _without_alias(path.stem) == wanted]
        if aliases:
            return tuple(aliases)
    return tuple(path for path in unused if _likeness(missing, path.stem) >= LEAST_LIKENESS)


def is_carrier(stem: str) -> bool:
    """Whether a mesh's name means what carries the others: that of a robot, or of a part of it."""
    return _without_alias(stem) == 'base'


def part_words(file: Path, folder: Path, wanted: PurePosixPath) -> set[str]:
    """
    Return the words by which the folders of a file below `folder` tell of one part of a robot.

    They are not in the wanted path, nor in the folder's own name, nor such as any robot has.
    """
    known = words(' '.join((*wanted.parts[:-1], folder.name)))
    return set(words(' '.join(file.relative_to(folder).parts[:-1]))) - set(known) - WHOLE


def _without_alias(stem: str) -> str:
    parts = re.split(r'[_\-. ]+', re.sub(r'base[_\- ]link', 'base', stem.lower()))
    return '_'.join(ALIASES.get(word, word) for word in parts)


def _likeness(one: str, other: str) -> float:
    """Return how alike two names are, 0 to 1; 0 when they differ in a side or a number."""
    if _marks(one) != _marks(other):
        return 0.0
    return difflib.SequenceMatcher(None, _core(one), _core(other)).ratio()


def _core(stem: str) -> str:
    """Return a name without the words that say nothing: `base` of `base_link`."""
    return '_'.join(word for word in words(stem) if word not in WEAK) or stem.lower()


def _marks(stem: str) -> list[str]:
    return sorted(word for word in words(stem) if word in SIDES.keys() | MARKS or word.isdigit())


def published_urdf(urdf: str, files: Mapping[str, Path]) -> str:
    """
    Return the URDF with file:// for each mesh that a listener would not find by its URL.

    `files` are those that were found, by URL. A `package://` of the ament index stays if that very
    mesh is there, as do file:// and the rest of the web; a mesh that was not found stays, too.
    """

    def replaced(match: 're.Match[str]') -> str:
        if match[1] is None:
            return match[0]
        url = ElementTree.fromstring(f'<mesh url={match[2]}/>').get('url', '')
        file = files.get(url)
        opened = opened_by_rviz(url)
        if file is None or opened is not None and (opened == file or _is_same(opened, file)):
            return match[0]
        return f'{match[1]}"{file.absolute().as_uri()}"'  # a URI has no quotation marks

    return MESH.sub(replaced, urdf)


def opened_by_rviz(url: str) -> Path | None:
    """
    Return the file that RViz would open for a URL; None when there is none.

    Its rule: `package://` goes through the ament index of AMENT_PREFIX_PATH, `file://` is an
    absolute path, a relative name means nothing.
    """
    file = None
    if url.startswith(PACKAGE):
        package, _, path = url.removeprefix(PACKAGE).partition('/')
        share = _share(package)
        file = share / path if share is not None else None
    elif url.startswith('file:///'):
        file = Path(unquote(url.removeprefix('file://')))
    return file if file is not None and os.path.isfile(file) else None


def _share(package: str) -> Path | None:
    for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
        if prefix and os.path.isfile(
            Path(prefix, 'share/ament_index/resource_index/packages', package)
        ):
            return Path(prefix, 'share', package)
    return None
