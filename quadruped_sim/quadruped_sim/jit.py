# SPDX-License-Identifier: Apache-2.0
"""Compilation of the hot numeric functions: once per machine, then loaded from numba's cache."""

from collections.abc import Callable
from typing import cast, ParamSpec, TypeVar

import numba

_P = ParamSpec('_P')
_R = TypeVar('_R')


def jit(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` on its first call; the result is cached on disk where possible."""
    try:
        return cast('Callable[_P, _R]', numba.njit(cache=True)(function))
    except RuntimeError:  # neither the package's folder nor a user cache can be written
        return cast('Callable[_P, _R]', numba.njit(function))
