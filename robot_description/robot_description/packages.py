# SPDX-License-Identifier: Apache-2.0
"""Where packages keep their shared files: the one place that knows which home we are in."""

from collections.abc import Iterator, Sequence
from functools import cache
import importlib.util
import os
from pathlib import Path
import sys

from wasd_core.errors import PackageNotFound

from robot_description.package_tree import manifest_name
from robot_description.package_tree import own_folder
from robot_description.package_tree import packages_below
from robot_description.package_tree import workspaces

# Packages of this project: their shared files lie inside the import package, in every home.
OWN_PACKAGES = (
    'diff_drive_sim',
    'mujoco_sim',
    'quadruped_sim',
    'robot_description',
    'teleop_keyboard',
    'wasd_bringup',
)
EXAMPLE_ROBOT_DATA = 'example-robot-data'


class PackageFinder:
    """
    Finds the folders that `$(find name)` and `package://name` mean; keeps what it has looked at.

    `search` are folders given by the user: each is the package itself, or holds it anywhere.
    Then come the ament index of AMENT_PREFIX_PATH and of this Python's prefix, the workspace
    around `description`, ROS_PACKAGE_PATH, and the robots of example-robot-data. Our own
    packages come first for our own descriptions, and behind the workspace for others'.
    """

    def __init__(self, search: Sequence[Path] = (), description: Path | None = None) -> None:
        self.search = tuple(Path(folder).resolve() for folder in search)
        self._description = description
        self._own = own_folder(description) if description is not None else None
        self._around = workspaces(description) if description is not None else []
        self._below = cache(packages_below)

    def folders(self, name: str) -> Iterator[Path]:
        """Yield the folders of packages of that name, the one that counts first."""
        seen = set()
        for folder in self._candidates(name):
            if folder not in seen:
                seen.add(folder)
                yield folder

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

    def _candidates(self, name: str) -> Iterator[Path]:
        if not name or '/' in name or name.startswith('.'):
            return
        for folder in self.search:
            yield from self._in_given_folder(folder, name)
        own = _import_folder(name) if name in OWN_PACKAGES else None
        if own is not None and self._is_ours(own):
            yield own
        for prefix in _ament_prefixes():
            if own is not None and prefix == Path(sys.prefix):
                continue  # what the wheel put there is a copy of our own, which has its turn
            if (prefix / 'share/ament_index/resource_index/packages' / name).is_file():
                yield prefix / 'share' / name
        # Before those around it, and also in a copy without its package.xml.
        if self._own is not None and name in (self._own.name, manifest_name(self._own)):
            yield self._own
        for folder in (*self._around, *_ros_package_path()):
            yield from self._below(folder).get(name, [])
        if own is not None:
            yield own
        for folder in _data_folders():
            if name == EXAMPLE_ROBOT_DATA:
                yield folder.parent
            elif (folder / name).is_dir():
                yield folder / name

    def _in_given_folder(self, folder: Path, name: str) -> Iterator[Path]:
        for candidate in (folder, folder / name):
            # The name of a clone's folder need not be that of the package in it.
            if candidate.is_dir() and name in (candidate.name, manifest_name(candidate)):
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
    own = [folder for name in OWN_PACKAGES if (folder := _import_folder(name)) is not None]
    return [*own, *_data_folders(), *(prefix / 'share' for prefix in _ament_prefixes())]


def _import_folder(name: str) -> Path | None:
    found = importlib.util.find_spec(name)
    if found is None or not found.submodule_search_locations:
        return None
    return Path(found.submodule_search_locations[0])


def _data_folders() -> list[Path]:
    """
    Return where example-robot-data keeps its robots: as a wheel, or in an ament prefix.

    The wheel may lie in any folder that Python imports from, that of `pip install --user`, too.
    """
    relative = Path('share', EXAMPLE_ROBOT_DATA, 'robots')
    wheels = [Path(entry, 'cmeel.prefix') for entry in dict.fromkeys(sys.path) if entry]
    roots = [*wheels, *_ament_prefixes()]
    return [root / relative for root in roots if (root / relative).is_dir()]


def _ament_prefixes() -> list[Path]:
    listed = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    return [Path(entry) for entry in dict.fromkeys([*listed, sys.prefix]) if entry]


def _ros_package_path() -> list[Path]:
    listed = os.environ.get('ROS_PACKAGE_PATH', '').split(os.pathsep)
    return [Path(entry) for entry in listed if entry and Path(entry).is_dir()]
