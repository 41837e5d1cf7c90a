# SPDX-License-Identifier: Apache-2.0
"""Packages as they lie in a source tree: found by the name in their package.xml."""

from collections.abc import Iterator
import os
from pathlib import Path
import re
import tempfile

MANIFEST = 'package.xml'
# Folders that hold a robot's description beside its meshes, where there is no package.xml.
DESCRIPTION_FOLDERS = {'urdf', 'urdfs', 'xacro', 'robot', 'robots', 'model', 'models', 'sdf'}
# No package hides in these, or it is a copy.
SKIPPED = {'build', 'install', 'log', 'node_modules', '__pycache__'}
IGNORE_MARKERS = {'COLCON_IGNORE', 'AMENT_IGNORE', 'CATKIN_IGNORE', 'pyvenv.cfg'}
# How far up a package or workspace is looked for, how many folders are looked through.
LEVELS = 6
MOST_FOLDERS = 20_000


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
        if (folder / MANIFEST).is_file():
            return folder
    return None


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


def workspaces(description: Path) -> list[Path]:
    """
    Return the folders in which a description's neighbours lie, the closest first.

    They are what holds its package, and the clones and `src` folders around it.
    """
    package = own_package(description)
    # In a folder that is everybody's lie strangers, and very many of them.
    around = [package.parent] if package is not None else []
    around = [folder for folder in around if folder not in _everybodys()]
    for folder in _above(description):
        if folder.name == 'src' or (folder / '.git').exists():
            around.append(folder)
    return list(dict.fromkeys(around))


def packages_below(folder: Path) -> dict[str, list[Path]]:
    """Return the packages in a folder, itself included, by name; links are not followed."""
    packages: dict[str, list[Path]] = {}
    for place in _folders_below(folder):
        name = manifest_name(place)
        if name is not None:
            packages.setdefault(name, []).append(place)
    return packages


def _folders_below(folder: Path) -> Iterator[Path]:
    for count, (place, folders, files) in enumerate(os.walk(folder)):
        if count > MOST_FOLDERS:
            return
        is_package = MANIFEST in files
        if is_package or IGNORE_MARKERS & set(files):
            folders.clear()  # packages do not nest
        folders[:] = sorted(
            name for name in folders if name not in SKIPPED and not name.startswith('.')
        )
        if is_package:
            yield Path(place)


def _above(description: Path) -> Iterator[Path]:
    """Yield the folders above a file, up to where everybody's things lie."""
    for folder in list(Path(os.path.normpath(description.absolute())).parents)[:LEVELS]:
        if folder in _everybodys():
            return
        yield folder


def _everybodys() -> set[Path]:
    """Return the folders in which everybody's things lie."""
    return {Path('/'), Path.home(), Path(tempfile.gettempdir())}


def _manifest(folder: Path) -> str:
    try:
        with open(folder / MANIFEST, encoding='utf-8', errors='replace') as file:
            return re.sub(r'<!--.*?-->', '', file.read(100_000), flags=re.DOTALL)
    except OSError:
        return ''
