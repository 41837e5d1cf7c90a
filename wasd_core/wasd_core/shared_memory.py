# SPDX-License-Identifier: Apache-2.0
"""
Checks and cleans Fast DDS's files in shared memory.

A killed process leaves half a megabyte in shared memory each time. A participant holds a lock on
`fastrtps_ID_el` as long as it lives, and the system releases it however the process ends. Fast
DDS itself never looks again: `fastdds shm clean` does, by hand. Ports (`fastrtps_portN`) are left
alone: who comes next takes them over, so they do not add up.

Fast DDS believes what it finds: it waits for ever for an empty port to be filled, and where the
folder is full, or a lock is empty, the kernel ends it (SIGBUS). So we look first.
"""

import contextlib
import fcntl
import os
from pathlib import Path
import re
import stat
import time

from wasd_core.errors import UserError

SHARED_MEMORY = Path('/dev/shm')
# Fast DDS' ports of a domain, and their locks; numbered as UDP's are by the RTPS specification.
PORT = re.compile(r'(?:sem\.)?fastrtps_port(\d+)(_mutex|_el)?')
FIRST_PORT, PORTS_OF_DOMAIN = 7400, 250
# A participant takes half a megabyte, a run several of them, and each listener its own [B].
ROOM = 8_000_000
MOST_FILES = 100
SEGMENT_LOCK = re.compile(r'fastrtps_[0-9a-f]{16}_el')
# One as young as this may belong to a participant that is about to lock it [s].
YOUNG_SEGMENT = 60.0
# What LTTng maps: of all users, and of one.
TRACING = re.compile(r'lttng-ust-wait-\d+(?:-\d+)?')
TRACING_ROOM = 64_000
# So long a file may be empty while another process, on a busy machine, makes it [s].
MAKING = 1.0


def why_no_shared_memory(domain: int, folder: Path = SHARED_MEMORY) -> str:
    """
    Return why Fast DDS should not use shared memory in a domain; '' where it can.

    A port or lock of another user is his to change, an empty one is never filled, and memory
    that is full ends the process that writes to it.
    """
    try:
        status, names = os.statvfs(folder), os.listdir(folder)
    except OSError as error:
        return f'{folder}: {error.strerror}'
    if not os.access(folder, os.W_OK | os.X_OK):
        return f'{folder} cannot be written'
    room = status.f_bavail * status.f_frsize
    if room < ROOM or (status.f_files and status.f_favail < MOST_FILES):
        return f'{folder} is full: {room / 1e6:.1f} MB and {status.f_favail} files are left'
    first = FIRST_PORT + PORTS_OF_DOMAIN * domain
    for name in sorted(names):
        port = PORT.fullmatch(name)
        if port and first <= int(port[1]) < first + PORTS_OF_DOMAIN:
            reason = _why_unusable(folder / name, may_be_empty=port[2] == '_el')
            if reason:
                return f'{folder / name} {reason}'
    return ''


def look_before_ros(folder: Path = SHARED_MEMORY) -> None:
    """
    See to it that ROS can be loaded: its tracing (LTTng) writes a page or two there at once.

    Raises:
        UserError: why the kernel would end this process for it.
    """
    remove_segments_of_the_dead(folder)
    try:
        status = os.statvfs(folder)
        pages = [path for path in folder.iterdir() if TRACING.fullmatch(path.name)]
        reasons = [_why_no_tracing(path) for path in pages if path.name.count('-') == 3]
        written = sum(path.lstat().st_blocks > 0 for path in pages)
    except OSError:
        return  # nor does LTTng find anything there
    room = status.f_bavail * status.f_frsize
    reason = next(filter(None, reasons), '')
    if room < TRACING_ROOM and written < 2:
        reason = reason or f'{folder} is full: make room, {TRACING_ROOM // 1000} kB at least'
    if reason:
        raise UserError(f'ROS cannot be loaded: {reason}')


def _why_no_tracing(path: Path) -> str:
    status = path.lstat()
    is_usable = status.st_size >= os.sysconf('SC_PAGESIZE') or os.access(path, os.W_OK)
    if is_usable or not stat.S_ISREG(status.st_mode):
        return ''
    return f'{path} is empty and belongs to user {status.st_uid}: ask for its removal'


def _why_unusable(path: Path, may_be_empty: bool) -> str:
    deadline = time.monotonic() + MAKING
    while True:
        try:
            status = path.lstat()
        except OSError:  # it has been removed
            return ''
        if status.st_uid != os.geteuid():
            return f'belongs to user {status.st_uid}'
        if not stat.S_ISREG(status.st_mode):
            return 'is no file'
        if status.st_size or may_be_empty:
            return ''
        if time.monotonic() > deadline or time.time() - status.st_mtime > MAKING:
            return 'is empty: remove it'
        time.sleep(0.01)


def remove_segments_of_the_dead(folder: Path = SHARED_MEMORY) -> list[str]:
    """
    Remove segments of this user whose owner lives no more; return their names.

    Those younger than YOUNG_SEGMENT stay. Whatever cannot be looked at or removed stays, too.
    """
    try:
        names = [entry.name for entry in os.scandir(folder) if SEGMENT_LOCK.fullmatch(entry.name)]
    except OSError:
        return []
    return [name.removesuffix('_el') for name in names if _remove_if_dead(folder / name)]


def _remove_if_dead(lock: Path) -> bool:
    """Remove a segment and its lock while we hold the lock: then nobody else does."""
    try:
        with open(os.open(lock, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC), 'rb') as file:
            status = os.fstat(file.fileno())
            if status.st_uid != os.geteuid() or time.time() - status.st_mtime < YOUNG_SEGMENT:
                return False
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with contextlib.suppress(FileNotFoundError):
                lock.with_name(lock.name.removesuffix('_el')).unlink()
            lock.unlink()
    except OSError:
        return False
    return True
