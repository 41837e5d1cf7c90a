# SPDX-License-Identifier: Apache-2.0
"""The shared parts of all packages: errors, parameters, nodes, records of the robot."""

import os
import sys

from wasd_core.ownership import others_can_write


def _leave_foreign_folder() -> None:
    """Look for no modules where the user stands, as `python -c` does, if that is a stranger's."""
    reason = others_can_write(os.stat('.')) if sys.path[:1] == [''] else ''
    if reason:
        del sys.path[0]
        cure = 'PYTHONPATH=. allows them'
        print(f'wasd: ignores modules of this folder, which {reason}; {cure}', file=sys.stderr)


# Before anything that is not loaded yet.
_leave_foreign_folder()


def quiet_start(package: str, *executables: str) -> None:
    """
    Let Ctrl-C end a program of a package silently while the program loads.

    Called first in a package; where it is imported into another program nothing happens. What
    the program does with signals later is its own affair. So nothing heavy is imported here. Nor
    is anything imported from the folder where the user stands: `python -m` looks there first.
    """
    name = sys.argv[0].rpartition('/')[2] if sys.argv else ''
    if name == '-m':
        rest = sys.orig_argv[sys.orig_argv.index('-m') + 1 :]
        is_ours = rest[:1] != [] and rest[0].partition('.')[0] == package
        if is_ours and not sys.flags.safe_path and not _is_at_home(sys.path[0]):
            del sys.path[0]
    else:
        is_ours = name in executables
    import signal

    if is_ours and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def _is_at_home(folder: str) -> bool:
    """Whether our packages are found in a folder."""
    return folder == os.path.dirname(os.path.dirname(__file__))
