# SPDX-License-Identifier: Apache-2.0
"""Tells which files of a folder anybody opens (inotify)."""

from collections.abc import Iterator
import contextlib
import ctypes
import os
from pathlib import Path
import struct

IN_OPEN = 0x20
NONBLOCKING = os.O_NONBLOCK
EVENT = struct.Struct('iIII')


@contextlib.contextmanager
def opened_in(folder: Path) -> Iterator[set[str]]:
    """Context after which the set has the names of the files in a folder that were opened."""
    libc = ctypes.CDLL(None, use_errno=True)
    watch = libc.inotify_init1(NONBLOCKING)
    assert libc.inotify_add_watch(watch, os.fsencode(folder), IN_OPEN) >= 0, ctypes.get_errno()
    names: set[str] = set()
    try:
        yield names
    finally:
        with contextlib.suppress(BlockingIOError):
            while data := os.read(watch, 1 << 16):
                names |= _names(data)
        os.close(watch)


def _names(data: bytes) -> set[str]:
    names = set()
    while data:
        length = EVENT.unpack_from(data)[3]
        name, data = data[EVENT.size : EVENT.size + length], data[EVENT.size + length :]
        names.add(os.fsdecode(name.rstrip(b'\0')))
    return names - {''}
