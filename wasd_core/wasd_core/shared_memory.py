# SPDX-License-Identifier: Apache-2.0
"""
What Fast DDS leaves in shared memory when a process is killed, half a megabyte each time.

A participant holds a lock on `fastrtps_ID_el` as long as it lives, and the system releases it
however the process ends. Fast DDS itself never looks again: `fastdds shm clean` does, by hand.
Ports (`fastrtps_portN`) are left alone: who comes next takes them over, so they do not add up.
"""

import contextlib
import fcntl
import os
from pathlib import Path
import re
import time

FOLDER = Path('/dev/shm')
LOCK = re.compile(r'fastrtps_[0-9a-f]{16}_el')
# One as young as this may belong to a participant that is about to lock it [s].
YOUNG = 60.0


def remove_segments_of_the_dead(folder: Path = FOLDER, young: float = YOUNG) -> list[str]:
    """
    Remove segments of this user whose owner lives no more; return their names.

    Those younger than `young` [s] stay. Whatever cannot be looked at or removed stays, too.
    """
    try:
        names = [entry.name for entry in os.scandir(folder) if LOCK.fullmatch(entry.name)]
    except OSError:
        return []
    return [name.removesuffix('_el') for name in names if _remove_if_dead(folder / name, young)]


def _remove_if_dead(lock: Path, young: float) -> bool:
    """Remove a segment and its lock while we hold the lock: then nobody else does."""
    try:
        with open(os.open(lock, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC), 'rb') as file:
            status = os.fstat(file.fileno())
            if status.st_uid != os.geteuid() or time.time() - status.st_mtime < young:
                return False
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with contextlib.suppress(FileNotFoundError):
                lock.with_name(lock.name.removesuffix('_el')).unlink()
            lock.unlink()
    except OSError:
        return False
    return True
