# SPDX-License-Identifier: Apache-2.0
"""What every package here shares: errors, parameters, nodes, records of the robot."""

import signal
import sys


def quiet_start(package: str, *executables: str) -> None:
    """
    Have Ctrl-C end one of a package's programs without a word while it is being loaded.

    Called first in a package; where it is imported into another program nothing happens. What
    the program does with signals later is its own affair.
    """
    name = sys.argv[0].rpartition('/')[2] if sys.argv else ''
    if name == '-m':
        rest = sys.orig_argv[sys.orig_argv.index('-m') + 1 :]
        is_ours = rest[:1] != [] and rest[0].partition('.')[0] == package
    else:
        is_ours = name in executables
    if is_ours and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
