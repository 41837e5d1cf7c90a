# SPDX-License-Identifier: Apache-2.0
"""Uses a kernel in a process forked of one in which numba has compiled: that is there sooner."""

import importlib
from multiprocessing.connection import Connection
import os
from pathlib import Path
import sys

import numba
import wasd_core.jit  # noqa: F401

numba.njit(lambda number: number + 1)(1)  # loads all that numba compiles with


def use(place: Path, environment: dict[str, str], errors: Path, talk: Connection) -> None:
    """Load `kernels.size` in a folder, say so, wait, call it; say its value and its cache hits."""
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(place)
    os.dup2(os.open(errors, os.O_CREAT | os.O_TRUNC | os.O_WRONLY, 0o600), 2)
    sys.path.insert(0, str(place))
    size = importlib.import_module('kernels.size').size
    talk.send('ready')
    talk.recv()
    talk.send(' '.join(map(str, [size(), *size.stats.cache_hits.values()])))
