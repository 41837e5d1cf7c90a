# SPDX-License-Identifier: Apache-2.0
"""Which files a description may name: its package's, found packages', those of given folders."""

from collections.abc import Sequence
from pathlib import Path

from wasd_core.errors import DescriptionError

from robot_description.package_tree import MANIFEST
from robot_description.package_tree import own_folder
from robot_description.packages import installed_folders
from robot_description.packages import PackageFinder


class Reach:
    """
    The folders that a description may read from.

    These are its own (see `own_folder`), those in `search`, installed packages, and packages
    found by name. Where a path leads counts, with `..` and symbolic links followed.
    """

    def __init__(self, description: Path, search: Sequence[Path] = ()) -> None:
        self._finder = PackageFinder(search, description)
        self._folders = {own_folder(description), *installed_folders(), *search}
        # A link to a description (colcon's symlink install) leads to its package as well.
        self._folders.add(own_folder(_resolved(description)))

    def package(self, name: str) -> Path:
        """
        Return the folder of a package, which may be read from then on.

        Raises:
            PackageNotFound: says where was looked.
        """
        folder = self._finder.find(name)
        manifest = _resolved(folder / MANIFEST)
        self._folders.add(folder)
        if manifest.name == MANIFEST:
            self._folders.add(manifest.parent)
        return folder

    def check(self, path: Path) -> Path:
        """
        Return the path if it may be read.

        Raises:
            DescriptionError: it leads out of every folder.
        """
        target = _resolved(path)
        if any(target.is_relative_to(folder.resolve()) for folder in self._folders):
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
