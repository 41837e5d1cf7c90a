# SPDX-License-Identifier: Apache-2.0
"""The wasd command: composes and starts everything."""

from importlib import import_module
from typing import Any

from wasd_core import quiet_start

quiet_start(__name__, 'wasd')

# Where each name is defined; loaded when it is asked for, as simulator and ROS take a while.
_HOMES = {
    'ROBOTS': 'robots',
    'RobotRow': 'robots',
    'RunOptions': 'options',
    'Session': 'session',
    'Stack': 'stack',
    'main': 'cli',
    'make_parser': 'cli',
    'read_options': 'options',
}
__all__ = list(_HOMES)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    """
    Return a public name from where it is defined.

    Raises:
        AttributeError: it is none.
    """
    if name not in _HOMES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_HOMES[name]}'), name)
