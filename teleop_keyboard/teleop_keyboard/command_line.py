# SPDX-License-Identifier: Apache-2.0
"""Options of the executables that read keys; what is ROS's is left to ROS."""

from collections.abc import Sequence
from typing import NamedTuple

from robot_description.argument_parser import OneLineParser
from robot_description.output_file import OutputFile


class KeyOptions(NamedTuple):
    """Where the keys are saved, if anywhere, and what is left for ROS."""

    save_keys: OutputFile | None
    ros: list[str]


def read_options(program: str, words: Sequence[str]) -> KeyOptions:
    """
    Return the options given to a program.

    Raises:
        UserError: an option that neither we nor ROS know, or a file that cannot be written.
    """
    parser = OneLineParser(prog=program, allow_abbrev=False, epilog='--ros-args ... goes to ROS.')
    parser.add_argument('--save-keys', metavar='FILE', help='write a key script, as --play reads')
    start = list(words).index('--ros-args') if '--ros-args' in words else len(words)
    given = parser.parse_args(list(words[:start]))
    save_keys = None if given.save_keys is None else OutputFile(given.save_keys, '--save-keys')
    return KeyOptions(save_keys, list(words[start:]))
