# SPDX-License-Identifier: Apache-2.0
"""Optional parts of an installation, by the name of their extra."""

from importlib import import_module
import sys
from typing import Any

from wasd_core.errors import UserError

DISTRIBUTION = 'wasd-robots'


def install_line(extra: str) -> str:
    """Return what to type to get an extra."""
    return f"{sys.executable} -m pip install '{DISTRIBUTION}[{extra}]'"


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
