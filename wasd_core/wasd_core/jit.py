# SPDX-License-Identifier: Apache-2.0
"""Compiles functions by numba, and caches the code while it is valid."""

from collections.abc import Callable, Iterator
import contextlib
import functools
import glob
import hashlib
import inspect
from pathlib import Path
import sys
from typing import Any, cast, ParamSpec, TypeVar

# First, for it sees to what numba reads.
from wasd_core.own_numba import folder_of, OwnCache  # isort: skip

import numba
from numba.core import event
import numpy as np

_P = ParamSpec('_P')
_R = TypeVar('_R')
# How long the name of a state is.
_DIGITS = 16


def jit(function: Callable[_P, _R], **options: Any) -> Callable[_P, _R]:
    """
    Compile `function` on its first call; the result is cached on disk where possible.

    `options` are numba's. What was compiled of another state of the function's package, or of
    this one, is not used: a compiled function calls only those of its own package, and knows
    constants of this one. No wrapper for callers in C is compiled: there are no such callers, and
    it takes a seventh of the time.
    """
    options = {'no_cfunc_wrapper': True, **options}
    kernel = numba.njit(**options)(function)
    if not hasattr(kernel, '_cache'):  # numba is told to compile nothing
        return cast('Callable[_P, _R]', kernel)
    kept = _keep(function)
    if kept is not None:  # else there is no place that only we can write
        kernel._cache = kept
    return cast('Callable[_P, _R]', kernel)


@contextlib.contextmanager
def before_each_compilation(act: Callable[[], None]) -> Iterator[None]:
    """Call `act` before numba compiles a function, not when it loads one; it may raise."""
    with event.install_listener('numba:compile', _Listener(act)):
        yield


class _Listener(event.Listener):
    def __init__(self, act: Callable[[], None]) -> None:
        self._act = act

    def on_start(self, event: Any) -> None:
        self._act()

    def on_end(self, event: Any) -> None:
        """Nothing to do."""


def _keep(function: Callable[..., Any]) -> OwnCache | None:
    """
    Return a function's cache, in a folder for each state of what it compiles; None for no cache.

    numba looks at the file of a function alone: not at those of the functions that it calls,
    which are compiled into it, nor whether a class that its cache names has moved. A process that
    began before a file changed keeps what it compiles from those that began later.
    """
    package = function.__module__.partition('.')[0]
    places = getattr(sys.modules.get(package), '__path__', None) or [inspect.getfile(function)]
    folder = _folder_of(package, tuple(places))
    return None if folder is None else OwnCache(function, folder)


@functools.cache
def _folder_of(package: str, places: tuple[str, ...]) -> Path | None:
    text = ''.join(map(_text_of, (Path(__file__).parent, *map(Path, places))))
    versions = f'{numba.__version__} {np.__version__}'
    digest = hashlib.sha256(f'{versions}{text}'.encode()).hexdigest()
    return folder_of(digest[:_DIGITS], package)


@functools.cache
def _text_of(package: Path) -> str:
    """Return the names of a package's files and what is in them; likewise of a single file."""
    if not package.is_dir():
        return package.read_text()
    lines = []
    # A package may have several names: colcon's workspace has links to the checkout.
    for name in sorted(glob.glob('**/[!.]*.py', root_dir=package, recursive=True)):
        # What an editor has just replaced is looked at by the next start.
        with contextlib.suppress(OSError):
            lines.append(f'{name}\n{(package / name).read_text()}')
    return '\n'.join(lines)
