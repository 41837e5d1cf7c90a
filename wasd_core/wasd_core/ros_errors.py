# SPDX-License-Identifier: Apache-2.0
"""What rcl refuses, in one line: its errors are mostly a user's arguments and remappings."""

from collections.abc import Iterator
import contextlib

from rclpy._rclpy_pybind11 import RCLError
from rclpy._rclpy_pybind11 import UnknownROSArgsError

from wasd_core.errors import UserError


@contextlib.contextmanager
def explained() -> Iterator[None]:
    """
    Context in which ROS is initialised and nodes are made.

    Raises:
        UserError: rcl's reason, e.g. an argument that is none, or a topic of two types.
    """
    try:
        yield
    except UnknownROSArgsError as error:
        raise UserError(f'unknown ROS arguments: {error}') from None
    except RCLError as error:
        raise UserError(f'ROS: {_first_words(str(error))}') from None


def _first_words(error: str) -> str:
    """Return rcl's error without where in its sources it arose."""
    said = error.removeprefix('failed to initialize rcl: ').partition(', at ')[0]
    what, _, why = said.partition('. Error: ')
    # What its lexer expected is a number.
    return what if not why or 'lexeme' in why else f'{what}: {why}'
