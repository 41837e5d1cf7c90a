# SPDX-License-Identifier: Apache-2.0
"""Where packages keep their shared files: the one place that knows which home we are in."""

from collections.abc import Sequence
import importlib.util
import os
from pathlib import Path
import sys
import sysconfig

from robot_description.errors import PackageNotFound

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


def share_directory(name: str, search: Sequence[Path] = ()) -> Path:
    """
    Return the folder that `$(find name)` and `package://name` mean.

    `search` are folders given by the user: each is the package itself or holds it. Then come
    our own packages, then the robots of example-robot-data, then the ament index of
    AMENT_PREFIX_PATH and of this Python's prefix.

    Raises:
        PackageNotFound: says where was looked.
    """
    for folder in map(Path.resolve, search):
        for candidate in (folder, folder / name):
            if candidate.name == name and candidate.is_dir():
                return candidate
    if name in OWN_PACKAGES and (own := _import_folder(name)) is not None:
        return own
    for folder in _data_folders():
        if name == EXAMPLE_ROBOT_DATA:
            return folder.parent
        if (folder / name).is_dir():
            return folder / name
    prefixes = _ament_prefixes()
    for prefix in prefixes:
        if (prefix / 'share/ament_index/resource_index/packages' / name).is_file():
            return prefix / 'share' / name
    places = ', '.join(str(place) for place in (*search, *prefixes)) or 'nowhere'
    raise PackageNotFound(f'package {name!r} not found; looked in {places}')


def _import_folder(name: str) -> Path | None:
    found = importlib.util.find_spec(name)
    if found is None or not found.submodule_search_locations:
        return None
    return Path(found.submodule_search_locations[0])


def _data_folders() -> list[Path]:
    """Return where example-robot-data keeps its robots: as a wheel, or in an ament prefix."""
    relative = Path('share', EXAMPLE_ROBOT_DATA, 'robots')
    wheel = Path(sysconfig.get_path('purelib')) / 'cmeel.prefix'
    roots = [wheel, *_ament_prefixes()]
    return [root / relative for root in roots if (root / relative).is_dir()]


def _ament_prefixes() -> list[Path]:
    listed = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    return [Path(entry) for entry in dict.fromkeys([*listed, sys.prefix]) if entry]
