# SPDX-License-Identifier: Apache-2.0
"""Compiles functions by numba, and keeps what it compiled for as long as it is true."""

from collections.abc import Callable
import contextlib
import functools
from pathlib import Path
import sys
from typing import Any, cast, ParamSpec, TypeVar

import numba

_P = ParamSpec('_P')
_R = TypeVar('_R')
_STAMP = 'compiled-of'


def jit(function: Callable[_P, _R], **options: Any) -> Callable[_P, _R]:
    """
    Compile `function` on its first call; the result is cached on disk where possible.

    `options` are numba's. What was compiled of another state of the function's package is
    forgotten first: a compiled function calls only those of its own package. Nothing is compiled
    for callers in C, which there are none of: that takes a seventh of the time.
    """
    options = {'no_cfunc_wrapper': True, **options}
    _forget_once(function.__module__.partition('.')[0])
    try:
        return cast('Callable[_P, _R]', numba.njit(cache=True, **options)(function))
    except RuntimeError:  # neither the package's folder nor a user cache can be written
        return cast('Callable[_P, _R]', numba.njit(**options)(function))


@functools.cache
def _forget_once(package: str) -> None:
    if places := getattr(sys.modules.get(package), '__path__', None):  # not of a single file
        forget_stale(Path(places[0]))


def forget_stale(package: Path) -> None:
    """
    Remove what was compiled of another state of a package's files.

    numba looks at the file of a function alone: not at those of the functions that it calls,
    which are compiled into it, nor whether a class that its cache names has moved.
    """
    stamp = package / '__pycache__' / _STAMP
    # Where nothing can be written nothing changes either, but by an installation; what an editor
    # has just replaced is looked at by the next start.
    with contextlib.suppress(OSError):
        stats = [(file, file.stat()) for file in sorted(package.rglob('[!.]*.py'))]
        # A package may have several names: colcon's workspace has links to the checkout.
        state = '\n'.join(
            f'{file.relative_to(package)} {stat.st_mtime_ns} {stat.st_size}'
            for file, stat in stats
        )
        if stamp.is_file() and stamp.read_text() == state:
            return
        for compiled in package.rglob('__pycache__/*.nb[ci]'):
            compiled.unlink(missing_ok=True)
        stamp.parent.mkdir(exist_ok=True)
        stamp.write_text(state)
