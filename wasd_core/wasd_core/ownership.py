# SPDX-License-Identifier: Apache-2.0
"""Whether another user can write a path."""

import os
import stat


def others_can_write(status: os.stat_result) -> str:
    """
    Return who but us and root may write to a file or folder; '' for nobody.

    A group of the number of its user is taken for his own, as Debian, Ubuntu and Fedora make one
    for each user.
    """
    if status.st_uid not in (0, os.geteuid()):
        return f'belongs to user {status.st_uid}'
    mode = f'(mode {stat.S_IMODE(status.st_mode):o})'
    if status.st_mode & stat.S_IWOTH:
        return f'can be written by any user {mode}'
    if status.st_mode & stat.S_IWGRP and status.st_gid != os.geteuid():
        return f'can be written by group {status.st_gid} {mode}'
    return ''


def why_foreign(path: str) -> str:
    """
    Return why another user could change what a path leads to, naming it or a folder above.

    '' where none could. Links are followed; for a path that does not exist yet the folders above
    count. A sticky folder above, of root or us, such as /tmp, is safe: others cannot replace our
    files in it.
    """
    real = here = os.path.realpath(path)
    while True:
        try:
            status = os.stat(here)
        except (FileNotFoundError, NotADirectoryError):
            reason = ''
        except OSError as error:
            reason = f'cannot be looked at: {error.strerror}'
        else:
            reason = others_can_write(status)
            is_on_the_way = here != real and status.st_mode & stat.S_ISVTX
            if is_on_the_way and status.st_uid in (0, os.geteuid()):
                reason = ''
        if reason:
            return f'{here} {reason}'
        if here == os.path.dirname(here):
            return ''
        here = os.path.dirname(here)
