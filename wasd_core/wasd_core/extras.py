# SPDX-License-Identifier: Apache-2.0
"""Optional parts of an installation, by the name of their extra."""

from importlib import import_module
import re
import shlex
import sys
from typing import Any

from wasd_core.errors import UserError

DISTRIBUTION = 'wasd-robots'


def install_line(extra: str) -> str:
    """Return what to type to get an extra: what it adds, as pip may not find all the rest."""
    # Here, because it takes a twentieth of a second to load, and hardly anybody is told this.
    from importlib import metadata

    try:
        lines = metadata.requires(DISTRIBUTION) or ()
    except metadata.PackageNotFoundError:
        lines = ()
    found = [re.fullmatch(f'(.+?) *; *extra == [\'"]{extra}[\'"]', line) for line in lines]
    adds = [match[1] for match in found if match] or [f'{DISTRIBUTION}[{extra}]']
    return shlex.join((sys.executable, '-m', 'pip', 'install', *adds))


def import_extra(module: str, extra: str, what: str) -> Any:
    """
    Return a module that comes with an extra.

    Raises:
        UserError: it is not installed; says that `what` needs it and how it comes.
    """
    try:
        return import_module(module)
    except ImportError:
        raise UserError(f'{what} needs: {install_line(extra)}') from None
