# SPDX-License-Identifier: Apache-2.0
"""Options of the executables that read keys; what is ROS's is left to ROS."""

import argparse
from collections.abc import Sequence
from typing import NamedTuple, NoReturn

from robot_description.errors import UserError


class KeyOptions(NamedTuple):
    """Where the keys are saved, if anywhere, and what is left for ROS."""

    save_keys: str | None
    ros: list[str]


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UserError(f'{message} (see: {self.prog} --help)')


def read_options(program: str, words: Sequence[str]) -> KeyOptions:
    """
    Return the options given to a program.

    Raises:
        UserError: an option that neither we nor ROS know.
    """
    parser = _Parser(prog=program, allow_abbrev=False, epilog='--ros-args ... goes to ROS.')
    parser.add_argument('--save-keys', metavar='FILE', help='write a key script, as --play reads')
    start = list(words).index('--ros-args') if '--ros-args' in words else len(words)
    given = parser.parse_args(list(words[:start]))
    return KeyOptions(given.save_keys, list(words[start:]))
