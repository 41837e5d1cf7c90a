# SPDX-License-Identifier: Apache-2.0
"""Compiles functions by numba, and keeps what it compiled for as long as it is true."""

from collections.abc import Callable, Iterator
import contextlib
import functools
import glob
import hashlib
from pathlib import Path
import sys
from typing import Any, cast, ParamSpec, TypeVar

# First, for it sees to what numba reads.
from wasd_core.own_numba import OwnCache  # isort: skip

import numba
from numba.core import event

_P = ParamSpec('_P')
_R = TypeVar('_R')
# How long a name of a state is; what stands before it in the name of a file.
_DIGITS, _OF = 16, 'of-'


def jit(function: Callable[_P, _R], **options: Any) -> Callable[_P, _R]:
    """
    Compile `function` on its first call; the result is cached on disk where possible.

    `options` are numba's. What was compiled of another state of the function's package, or of
    this one, is not used: a compiled function calls only those of its own package, and knows
    constants of this one. Nothing is compiled for callers in C, which there are none of: that
    takes a seventh of the time.
    """
    options = {'no_cfunc_wrapper': True, **options}
    kernel = numba.njit(**options)(function)
    if not hasattr(kernel, '_cache'):  # numba is told to compile nothing
        return cast('Callable[_P, _R]', kernel)
    with contextlib.suppress(RuntimeError):  # there is no place that only we can write
        kernel._cache = _keep_of_state(function)
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


def _keep_of_state(function: Callable[..., Any]) -> OwnCache:
    """
    Return a function's cache, which uses files of its own for each state of what it compiles.

    numba looks at the file of a function alone: not at those of the functions that it calls,
    which are compiled into it, nor whether a class that its cache names has moved. A process that
    began before a file changed keeps what it compiles from those that began later.
    """
    package = function.__module__.partition('.')[0]
    cache = OwnCache(function)
    cache.name_files(f'{_OF}{_state_of(package)}')
    _forget_once(cache.cache_path, package)
    return cache


def _folder_of(package: str) -> Path | None:
    """Return the folder of a package; None for a single file."""
    places = getattr(sys.modules.get(package), '__path__', None)
    return Path(places[0]) if places else None


@functools.cache
def _state_of(package: str) -> str:
    folder = _folder_of(package)
    text = _files_of(Path(__file__).parent) + ('' if folder is None else _files_of(folder))
    return hashlib.sha256(text.encode()).hexdigest()[:_DIGITS]


@functools.cache
def _files_of(package: Path) -> str:
    """Return the files of a package, and when they were written."""
    lines = []
    # A package may have several names: colcon's workspace has links to the checkout.
    for name in sorted(glob.glob('**/[!.]*.py', root_dir=package, recursive=True)):
        # What an editor has just replaced is looked at by the next start.
        with contextlib.suppress(OSError):
            stat = (package / name).stat()
            lines.append(f'{name} {stat.st_mtime_ns} {stat.st_size}')
    return '\n'.join(lines)


@functools.cache
def _forget_once(cache: str, package: str) -> None:
    """Remove what was compiled of another state of a package from a folder."""
    if _folder_of(package) is None:
        return  # beside a single file are those of others
    # What cannot be removed is not used either.
    with contextlib.suppress(OSError):
        for compiled in Path(cache).glob(f'*.{_OF}*.nb[ci]'):
            if f'.{_OF}{_state_of(package)}.' not in compiled.name:
                compiled.unlink(missing_ok=True)
