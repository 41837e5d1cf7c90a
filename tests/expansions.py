# SPDX-License-Identifier: Apache-2.0
"""
Remembers what our own descriptions, the G1's and those of the catalogue are.

Several tests read each of the catalogue: an expansion is a fork, up to a tenth of a second of a
processor where everything is loaded. Of ours the product itself remembers it, but to parse a
description takes as long again, and tests load the same few robots some thousand times: what is
found in one, legs and wheels, Pinocchio's model of it and MuJoCo's of a G1 stay with it. Lint, and
tests of expanding, expand by themselves; so does every program that is started from the beginning.
"""

from collections.abc import Callable
import copy
import functools
import os
from pathlib import Path
import sys
from types import SimpleNamespace
from typing import Any

import robot_description

OURS = Path(robot_description.__file__).parent / 'urdf'
CATALOGUE = Path(__file__).parent / 'catalogue'
# What decides where `$(find PACKAGE)` leads, and who opens the meshes anew.
PLACES = ('AMENT_PREFIX_PATH', 'ROS_PACKAGE_PATH', 'XDG_CACHE_HOME')


def remember() -> None:
    """Have descriptions remember their expansions from here on, in this process and its forks."""
    description: Any = sys.modules.get('robot_description.description')
    if description and not hasattr(description.expand_document, '__wrapped__'):
        description.expand_document = _remembering(description.expand_document)
        description.parse_description = _parsing_once(description.parse_description)
        description.equip = _keeping(description.equip)
    legs: Any = sys.modules.get('quadruped_sim.robot_model')
    if legs and not hasattr(legs.to_pinocchio, '__wrapped__'):
        legs.to_pinocchio = _keeping(legs.to_pinocchio)
    worlds: Any = sys.modules.get('wasd_bringup.run.worlds')
    if worlds and not hasattr(worlds.build_world, '__wrapped__'):
        worlds.build_world = _compiling_once(worlds.build_world)


def _remembering(expand: Callable[..., Any]) -> Callable[..., Any]:
    known: dict[Any, tuple[Any, list[Any]]] = {}

    @functools.wraps(expand)
    def expand_once(path: Path, arguments: Any = None, search: Any = ()) -> Any:
        if not _is_in(path, CATALOGUE, *_others()):
            return expand(path, arguments, search)
        places = tuple(map(os.environ.get, PLACES))
        key = (path, tuple(sorted((arguments or {}).items())), tuple(search), places)
        expansion, stamps = known.get(key, (None, []))
        if expansion is None or stamps != [_stamp(file) for file in expansion.files]:
            expansion = expand(path, arguments, search)
            known[key] = expansion, [_stamp(file) for file in expansion.files]
        return expansion

    return expand_once


def _parsing_once(parse: Callable[..., Any]) -> Callable[..., Any]:
    known: dict[Any, Any] = {}

    @functools.wraps(parse)
    def parse_once(urdf: str, path: Path, search: Any = ()) -> Any:
        if not _is_in(path, OURS, CATALOGUE, *_others()):
            return parse(urdf, path, search)
        key = (urdf, path, tuple(search), tuple(map(os.environ.get, PLACES)))
        if key not in known:
            known[key] = parse(urdf, path, search)
        return known[key]  # frozen

    return parse_once


def _keeping(make: Callable[..., Any]) -> Callable[..., Any]:
    """Keep what is made of a description with it: it is frozen, and that is not changed either."""

    @functools.wraps(make)
    def make_once(loaded: Any, **how: Any) -> Any:
        known = vars(loaded).setdefault(make.__name__, {})
        if (key := repr(how)) not in known:
            known[key] = make(loaded, **how)
        return known[key]

    return make_once


def _compiling_once(build: Callable[..., Any]) -> Callable[..., Any]:
    """Compile what is none of ours, a G1's meshes take 0.3 s, once; others get a copy of that."""

    @functools.wraps(build)
    def build_once(loaded: Any, world: str, seed: int, setup: Any, *others: Any) -> Any:
        # Other worlds are drawn by their seed.
        is_plain = world == 'flat' and setup.drawn == type(setup.drawn)()
        if not is_plain or not _is_in(loaded.path, *_others()):
            return build(loaded, world, seed, setup, *others)
        known = vars(loaded).setdefault('worlds', {})
        if (key := repr((setup, others))) in known:
            kind, model = known[key]
            again = SimpleNamespace(compile=functools.partial(copy.copy, model))
            return kind(again, loaded.robot.base, seed, setup)
        built = build(loaded, world, seed, setup, *others)
        known[key] = type(built), copy.copy(built.model)
        return built

    return build_once


@functools.cache
def _others() -> list[Path]:
    """Return the descriptions of others that have a short name."""
    from robot_description.packages import description_path, OTHERS

    return [description_path(name).resolve() for name in OTHERS]


def _is_in(path: Path, *places: Path) -> bool:
    file = path.resolve()
    return any(file.is_relative_to(place) for place in places)


def _stamp(file: Path) -> tuple[int, int] | None:
    try:
        status = file.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size
