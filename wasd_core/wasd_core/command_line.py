# SPDX-License-Identifier: Apache-2.0
"""The parser of every command line here: what is wrong is one line."""

import argparse
from typing import NoReturn

from wasd_core.errors import UserError


class OneLineParser(argparse.ArgumentParser):
    """An argparse parser, and of its commands, that raises instead of printing its usage."""

    def error(self, message: str) -> NoReturn:
        """
        Refuse the command line.

        Raises:
            UserError: always; its text names the help that tells more.
        """
        raise UserError(f'{message} (see: {self.prog} --help)')
