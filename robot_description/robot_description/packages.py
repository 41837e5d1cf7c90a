# SPDX-License-Identifier: Apache-2.0
"""Where packages keep their files, the robots among them, and what a description may read."""

from collections.abc import Iterator, Sequence
from functools import cache
import os
from pathlib import Path
import re
import sys
import tempfile

from wasd_core.errors import DescriptionError, one_line, PackageNotFound

MANIFEST = 'package.xml'
PACKAGE = 'package://'
# Folders that hold a robot's description beside its meshes, where there is no package.xml.
DESCRIPTION_FOLDERS = {'urdf', 'urdfs', 'xacro', 'robot', 'robots', 'model', 'models', 'sdf'}
# No package hides in these, or it is a copy.
SKIPPED = {'build', 'install', 'log', 'node_modules', '__pycache__'}
IGNORE_MARKERS = {'COLCON_IGNORE', 'AMENT_IGNORE', 'CATKIN_IGNORE', 'pyvenv.cfg'}
# How far up a package or workspace is looked for, how many folders are looked through.
LEVELS = 6
MOST_FOLDERS = 20_000
# The package with our robots: they lie inside the import package, in every home. What others of
# ours share lies where ament has it.
OWN_PACKAGE = 'robot_description'
EXAMPLE_ROBOT_DATA = 'example-robot-data'
DESCRIPTIONS = {
    'go2': 'urdf/go2/go2.urdf.xacro',
    'mbot': 'urdf/mbot/mbot.urdf.xacro',
    'mbot_bare': 'urdf/mbot/mbot_bare.urdf.xacro',
    'mbot_kinect': 'urdf/mbot/mbot_kinect.urdf.xacro',
}
# Those of others, by their package.
OTHERS = {'g1': ('g1_description', 'urdf/g1_29dof_rev_1_0.urdf')}


def manifest_name(folder: Path) -> str | None:
    """Return the name that a folder's package.xml gives; None when it is no package."""
    found = re.search(r'<name>\s*([^<\s]+)\s*</name>', _manifest(folder))
    return found[1] if found else None


def dependencies(folder: Path) -> set[str]:
    """Return the packages that a folder's package.xml depends on, in any way."""
    return set(re.findall(r'<\w*depend\b[^>]*>\s*([^<\s]+)\s*<', _manifest(folder)))


def own_package(description: Path) -> Path | None:
    """Return the package that a description file lies in: the nearest folder with a manifest."""
    for folder in _above(description):
        if os.path.isfile(folder / MANIFEST):
            return folder
    return None


def package_url(file: Path) -> str | None:
    """Return the URL of a file by its package; None for a file in none."""
    package = own_package(file)
    name = manifest_name(package) if package else None
    return f'{PACKAGE}{name}/{file.relative_to(package)}' if package and name else None


def own_folder(description: Path) -> Path:
    """
    Return the folder whose files a description may use as its own.

    It is its package; without one the folder it lies in, or the one above when that is called
    `urdf` or the like.
    """
    package = own_package(description)
    if package is not None:
        return package
    folder = description.absolute().parent
    return folder.parent if folder.name.lower() in DESCRIPTION_FOLDERS else folder


def linked(description: Path) -> tuple[Path, ...]:
    """Return the absolute path of a description, and of the file it links to, if another."""
    return tuple(dict.fromkeys((description.absolute(), _resolved(description))))


def source_of(description: Path) -> Path:
    """Return the file that a description links to, where that is in another package."""
    target = _resolved(description)
    is_here = target.is_relative_to(_resolved(own_folder(description)))
    return description if is_here else target


def workspaces(description: Path) -> list[Path]:
    """
    Return the folders in which a description's neighbours lie, the closest first.

    They are what holds its package, and the clones and `src` folders around it.
    """
    package = own_package(description)
    # A folder that all share holds very many things that do not belong together.
    around = [package.parent] if package is not None else []
    around = [folder for folder in around if folder not in _shared_folders()]
    for folder in _above(description):
        if folder.name == 'src' or os.path.exists(folder / '.git'):
            around.append(folder)
    return list(dict.fromkeys(around))


def packages_below(folder: Path) -> dict[str, list[Path]]:
    """Return the packages in a folder, itself included, by name; links are not followed."""
    packages: dict[str, list[Path]] = {}
    for count, (place, folders, files) in enumerate(os.walk(folder)):
        if count > MOST_FOLDERS:
            break
        is_package = MANIFEST in files
        if is_package or IGNORE_MARKERS & set(files):
            folders.clear()  # packages do not nest
        folders[:] = sorted(
            name for name in folders if name not in SKIPPED and not name.startswith('.')
        )
        if is_package and (name := manifest_name(Path(place))) is not None:
            packages.setdefault(name, []).append(Path(place))
    return packages


def _above(description: Path) -> Iterator[Path]:
    """Yield the folders above a file, up to those that all share."""
    for folder in list(Path(os.path.normpath(description.absolute())).parents)[:LEVELS]:
        if folder in _shared_folders():
            return
        yield folder


def _shared_folders() -> set[Path]:
    """Return the folders that all programs put things in."""
    return {Path('/'), Path.home(), Path(tempfile.gettempdir())}


def _manifest(folder: Path) -> str:
    try:
        with open(folder / MANIFEST, encoding='utf-8', errors='replace') as file:
            return re.sub(r'<!--.*?-->', '', file.read(100_000), flags=re.DOTALL)
    except OSError:
        return ''


class PackageFinder:
    """
    Finds the folders that `$(find name)` and `package://name` mean; keeps what it has looked at.

    `search` are folders given by the user: each is the package itself, or holds it anywhere.
    Then come the description's own package, the ament index of AMENT_PREFIX_PATH and of this
    Python's prefix, the workspace around `description`, ROS_PACKAGE_PATH, and the robots of
    example-robot-data. Our own packages come first for our own descriptions, and behind the
    workspace for others'.
    """

    def __init__(self, search: Sequence[Path] = (), description: Path | None = None) -> None:
        self.search = tuple(Path(folder).resolve() for folder in search)
        self._description = description
        paths = linked(description) if description is not None else ()
        self.own = tuple(dict.fromkeys(map(own_folder, paths)))
        self._around = list(dict.fromkeys(folder for p in paths for folder in workspaces(p)))
        self._below = cache(packages_below)
        self._folders: dict[str, tuple[Path, ...]] = {}

    def folders(self, name: str) -> tuple[Path, ...]:
        """Return the folders of packages of that name, the one that counts first."""
        if name not in self._folders:
            self._folders[name] = tuple(dict.fromkeys(self._candidates(name)))
        return self._folders[name]

    def find(self, name: str) -> Path:
        """
        Return the folder of a package.

        Raises:
            PackageNotFound: says where was looked.
        """
        for folder in self._candidates(name):
            return folder
        places = ', '.join(map(str, (*self.search, *self._around, *_ament_prefixes())))
        raise PackageNotFound(
            f'package {name!r} not found; looked in {places}; --package-path DIR adds a folder'
        )

    def own_named(self, name: str) -> list[Path]:
        """Return the description's own folders of that name, also without a package.xml."""
        return [own for own in self.own if name in (own.name, manifest_name(own))]

    def _candidates(self, name: str) -> Iterator[Path]:
        if not name or '/' in name or name.startswith('.'):
            return
        for folder in self.search:
            yield from self._in_given_folder(folder, name)
        own = _own_folder() if name == OWN_PACKAGE else None
        if own is not None and self._is_ours(own):
            yield own
        yield from self.own_named(name)
        for prefix in _ament_prefixes():
            if own is not None and prefix == Path(sys.prefix):
                continue  # what the wheel put there is a copy of our own, which has its turn
            if os.path.isfile(prefix / 'share/ament_index/resource_index/packages' / name):
                yield prefix / 'share' / name
        for folder in (*self._around, *_ros_package_path()):
            yield from self._below(folder).get(name, [])
        if own is not None:
            yield own
        for folder in _data_folders():
            if name == EXAMPLE_ROBOT_DATA:
                yield folder.parent
            elif os.path.isdir(folder / name):
                yield folder / name

    def _in_given_folder(self, folder: Path, name: str) -> Iterator[Path]:
        for candidate in (folder, folder / name):
            # The name of a clone's folder need not be that of the package in it.
            if os.path.isdir(candidate) and name in (candidate.name, manifest_name(candidate)):
                yield candidate
        yield from self._below(folder).get(name, [])

    def _is_ours(self, own: Path) -> bool:
        return self._description is None or own in self._description.absolute().parents


def share_directory(name: str, search: Sequence[Path] = ()) -> Path:
    """
    Return the folder that `$(find name)` and `package://name` mean, as PackageFinder finds it.

    Raises:
        PackageNotFound: says where was looked.
    """
    return PackageFinder(search).find(name)


def installed_folders() -> list[Path]:
    """Return the folders under which installed packages keep their shared files."""
    return [
        _own_folder(),
        *_data_folders(),
        *(prefix / 'share' for prefix in _ament_prefixes()),
    ]


def _own_folder() -> Path:
    return Path(__file__).parent


def _data_folders() -> list[Path]:
    """
    Return where example-robot-data keeps its robots: as a wheel, or in an ament prefix.

    The wheel may lie in any folder that Python imports from, that of `pip install --user`, too.
    """
    relative = Path('share', EXAMPLE_ROBOT_DATA, 'robots')
    wheels = [Path(entry, 'cmeel.prefix') for entry in dict.fromkeys(sys.path) if entry]
    roots = [*wheels, *_ament_prefixes()]
    return [root / relative for root in roots if os.path.isdir(root / relative)]


def _ament_prefixes() -> list[Path]:
    listed = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    return [Path(entry) for entry in dict.fromkeys([*listed, sys.prefix]) if entry]


def _ros_package_path() -> list[Path]:
    listed = os.environ.get('ROS_PACKAGE_PATH', '').split(os.pathsep)
    return [Path(entry) for entry in listed if entry and os.path.isdir(entry)]


def description_path(name_or_path: str) -> Path:
    """
    Return the description of a built-in robot, or the path itself when something is there.

    Raises:
        DescriptionError: when it is neither, which lists the names, or may not be looked at.
    """
    if name_or_path in DESCRIPTIONS:
        return share_directory('robot_description') / DESCRIPTIONS[name_or_path]
    if name_or_path in OTHERS:
        package, file = OTHERS[name_or_path]
        return share_directory(package) / file
    path = Path(name_or_path)
    try:
        os.lstat(path)
    except PermissionError as error:
        raise DescriptionError(f'{path}: {one_line(error)}') from None
    except (OSError, ValueError):  # ValueError: a NUL in the name
        pass
    else:
        return path
    raise DescriptionError(
        f'{name_or_path}: no such file, and no robot of that name; '
        f'robots: {", ".join(sorted((*DESCRIPTIONS, *OTHERS)))}'
    )


def readable_folder(text: str) -> Path:
    """
    Return a folder in which packages are to be looked for.

    Raises:
        DescriptionError: it is none, or may not be read.
    """
    if not os.path.isdir(text):
        reason = 'no such folder'
        try:
            os.stat(text)
        except PermissionError as error:
            reason = one_line(error)
        except (OSError, ValueError):
            pass
        raise DescriptionError(f'{text}: {reason}')
    if not os.access(text, os.R_OK | os.X_OK):
        raise DescriptionError(f'{text}: this folder may not be read')
    return Path(text)


class AllowedPaths:
    """
    The folders that a description may read from.

    These are its own (see `own_folder`), those in `search`, installed packages, and packages
    found by name. Where a path leads counts, with `..` and symbolic links followed.
    """

    def __init__(self, description: Path, search: Sequence[Path] = ()) -> None:
        self.finder = PackageFinder(search, description)
        self._added: set[Path] = set()
        self._folders: set[Path] = set()
        self.packages: list[Path] = list(self.finder.own)  # those that were found
        # A link to a description (colcon's symlink install) leads to its package as well.
        for folder in (*self.finder.own, *self.finder.search, *installed_folders()):
            self.add(folder)

    def add(self, folder: Path) -> None:
        """Allow a folder; of a package that colcon installed by links, its source as well."""
        if folder in self._added:
            return
        self._added.add(folder)
        manifest = _resolved(folder / MANIFEST)
        self._folders.add(_resolved(folder))
        if manifest.name == MANIFEST:
            self._folders.add(manifest.parent)

    def package(self, name: str) -> Path:
        """
        Return the folder of a package, which may be read from then on.

        Raises:
            PackageNotFound: says where was looked.
        """
        folder = self.finder.find(name)
        self.add(folder)
        self.packages.append(folder)
        return folder

    def has(self, path: Path) -> bool:
        """Whether a path leads into an allowed folder."""
        target = _resolved(path)
        return any(target.is_relative_to(folder) for folder in self._folders)

    def check(self, path: Path) -> Path:
        """
        Return the path if it may be read.

        Raises:
            DescriptionError: it leads out of every folder.
        """
        if self.has(path):
            return path
        raise DescriptionError(
            f'{path}: refused: it lies outside of the description, the packages found and '
            '--package-path'
        )


def _resolved(path: Path) -> Path:
    """Return where a path leads."""
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError):  # a circle of links, a NUL
        raise DescriptionError(f'{path}: leads nowhere (a circle of links?)') from None
