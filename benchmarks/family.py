# SPDX-License-Identifier: Apache-2.0
"""A benchmark's processes end with the one that has started them, however that ends."""

import contextlib
import ctypes
import multiprocessing
import os
from pathlib import Path
import signal
from typing import Any

SET_PARENT_DEATH_SIGNAL = 1  # of prctl(2)


def end_with_parent() -> None:
    """End this process and its children when its parent ends, even by a kill."""
    signal.signal(signal.SIGTERM, _end_all)
    ctypes.CDLL(None).prctl(SET_PARENT_DEATH_SIGNAL, signal.SIGTERM, 0, 0, 0)
    parent = multiprocessing.parent_process()
    if parent is not None and not parent.is_alive():  # since before the kernel was asked
        _end_all()


def _end_all(*_: Any) -> None:
    while children := _children_of(os.getpid()):
        for child in children:
            _kill(child)
    os._exit(1)


def _kill(process: int) -> None:
    """Kill a process and its children; it is stopped first, so that it starts no more."""
    # It has ended meanwhile, or is the child of a child.
    with contextlib.suppress(ProcessLookupError, ChildProcessError):
        os.kill(process, signal.SIGSTOP)
        for child in _children_of(process):
            _kill(child)
        os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)


def _children_of(process: int) -> list[int]:
    found = []
    for path in Path('/proc').glob('[0-9]*/stat'):
        with contextlib.suppress(OSError):  # it has ended meanwhile
            # Number, (name), state, parent: a name may have anything in it.
            parent = path.read_text().rpartition(')')[2].split()[1]
            found += [int(path.parent.name)] if int(parent) == process else []
    return found
