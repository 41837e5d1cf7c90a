# SPDX-License-Identifier: Apache-2.0
"""The user's folder of caches, which nobody else may write; nothing is kept beside the code."""

import functools
import os
from pathlib import Path
import sys

from wasd_core.ownership import why_foreign


@functools.cache
def say_once(text: str) -> None:
    """Say something on standard error, once in a process."""
    print(f'wasd: {text}', file=sys.stderr, flush=True)


def cache_folder(name: str) -> Path | None:
    """
    Return the folder `name` among the user's caches of wasd, made for him alone (mode 0700).

    It is in $XDG_CACHE_HOME or ~/.cache; where that cannot be written in the folder of temporary
    files, until the machine starts again; None where that cannot be, either. A line says so.
    """
    home = os.environ.get('XDG_CACHE_HOME', '')
    if not os.path.isabs(home):
        home = os.path.join(os.path.expanduser('~'), '.cache')
    top = _folder_in(home, os.environ.get('TMPDIR') or '/tmp')
    return _make(top / name) if top else None


@functools.cache
def _folder_in(home: str, temporary: str) -> Path | None:
    wanted = Path(home) / 'wasd'
    why = why_unfit(wanted)
    if not why:
        return wanted
    instead = Path(temporary) / f'wasd-{os.geteuid()}'
    if not why_unfit(instead):
        say_once(f'caches are kept in {instead}: {why}')
        return instead
    say_once(f'there are no caches, so each start takes longer: {why}')
    return None


def why_unfit(folder: Path) -> str:
    """Make a folder for the user alone; return why it cannot be used as one, '' if it can."""
    if not folder.is_absolute():
        return f'{folder} is no absolute path'
    # Before it is made, for a stranger gets nothing of ours; and after, if he was first.
    if why := why_foreign(str(folder)):
        return why
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        return f'cannot make {folder}: {error.strerror}'
    if not os.access(folder, os.W_OK | os.X_OK):
        return f'cannot write to {folder}'
    return why_foreign(str(folder))


@functools.cache
def _make(folder: Path) -> Path | None:
    return None if why_unfit(folder) else folder
