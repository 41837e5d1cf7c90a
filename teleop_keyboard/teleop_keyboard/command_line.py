# SPDX-License-Identifier: Apache-2.0
"""Options of the executables that read keys; what is ROS's is left to ROS."""

from collections.abc import Sequence
import sys
from typing import NamedTuple

from wasd_core.command_line import Executable
from wasd_core.output_file import OutputFile


class KeyOptions(NamedTuple):
    """Where the keys are saved, if anywhere, and what is left for ROS."""

    save_keys: OutputFile | None
    ros: list[str]


def read_options(program: Executable, words: Sequence[str] | None = None) -> KeyOptions:
    """
    Return the options given to a program; those of this process when there are no `words`.

    Raises:
        UserError: an option that neither we nor ROS know, or a file that cannot be written.
    """
    given = program.read(sys.argv[1:] if words is None else words)
    save_keys = None if given.save_keys is None else OutputFile(given.save_keys, '--save-keys')
    return KeyOptions(save_keys, given.ros)
