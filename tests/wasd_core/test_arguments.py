# SPDX-License-Identifier: Apache-2.0
"""Arguments are what a function's annotations say; all else is a line: what, got, wanted."""

from collections.abc import Mapping, Sequence
import os
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

from cases import for_all
import numpy as np
import pytest
from wasd_core.arguments import check, checked
from wasd_core.errors import UserError

NAN = float('nan')


class Load(NamedTuple):
    """A named tuple."""

    mass: float
    place: tuple[float, float]


@runtime_checkable
class Walks(Protocol):
    """Whatever has legs."""

    legs: int


class Robot:
    """What users call."""

    legs = 4

    @checked
    def __init__(self, world: str = 'flat', *, seed: int = 0) -> None:
        self.world, self.seed = world, seed

    @checked
    def drive(self, ahead: float, turn: float = 0.0) -> tuple[float, float]:
        """Return what it was told."""
        return ahead, turn


TAKEN: list[tuple[Any, Any]] = [
    (float, 1),
    (float, -2.5),
    (float, np.float32(1.5)),
    (float, np.array(1.5)),
    (int, 3),
    (int, np.int64(3)),
    (bool, False),
    (str, 'flat'),
    (str | os.PathLike[str], Path('flat')),
    (str | None, None),
    (Sequence[float], (1, 2.0)),
    (Sequence[float], np.zeros(3)),
    (Sequence[str | os.PathLike[str]], ['a', Path('b')]),
    (Sequence[str], ()),
    (tuple[float, float], [1, 2]),
    (Mapping[str, str], {'a': 'b'}),
    (Load, Load(1.0, (0, 0))),
    (Walks, Robot()),
    (Any, object()),
]
REFUSED: list[tuple[Any, Any, str]] = [
    (float, '1', "got '1', wanted a finite number"),
    (float, None, 'got None, wanted a finite number'),
    (float, NAN, 'got nan, wanted a finite number'),
    (float, float('inf'), 'got inf, wanted a finite number'),
    (float, 10**400, 'wanted a finite number'),
    (float, True, 'got True, wanted a finite number'),
    (float, 1j, 'got 1j, wanted a finite number'),
    (float, np.complex128(1), 'wanted a finite number'),
    (float, [1.0], 'got [1.0], wanted a finite number'),
    (float, np.zeros(1), 'got array([0.]), wanted a finite number'),
    (int, 1.0, 'got 1.0, wanted a whole number'),
    (int, True, 'got True, wanted a whole number'),
    (bool, 1, 'got 1, wanted True or False'),
    (str, 5, 'got 5, wanted a text'),
    (str, b'flat', "got b'flat', wanted a text"),
    (str, '', "got '', wanted a text"),
    (str | os.PathLike[str] | None, 5, 'got 5, wanted a text or a path or None'),
    (Sequence[float], 'abc', "got 'abc', wanted a list of finite numbers"),
    (Sequence[float], 5, 'got 5, wanted a list of finite numbers'),
    (Sequence[float], {1.0}, 'got {1.0}, wanted a list of finite numbers'),
    (Sequence[float], (1, NAN), 'got (1, nan), wanted a list of finite numbers'),
    (Sequence[float], np.array(1.0), 'got array(1.), wanted a list of finite numbers'),
    (Sequence[float], np.zeros((2, 1)), 'got array([[0.], [0.]]), wanted a list of'),
    (Sequence[str | os.PathLike[str]], [5], 'got [5], wanted a list of texts or paths'),
    (tuple[float, float], (1, 2, 3), 'got (1, 2, 3), wanted 2 finite numbers'),
    (Mapping[str, str], {'a': 5}, "got {'a': 5}, wanted a mapping from texts to texts"),
    (Mapping[str, str], [('a', 'b')], 'wanted a mapping from texts to texts'),
    (Load | None, 3, 'wanted Load(mass: a finite number, place: 2 finite numbers) or None'),
    (Load, Load(1.0, (0,)), 'got Load(mass=1.0, place=(0,)), wanted Load('),
    (Walks, 5, 'got 5, wanted Walks'),
]


@for_all(('wanted', 'value'), TAKEN)
def test_what_fits_is_taken(wanted: Any, value: Any):
    check('it', value, wanted)


@for_all(('wanted', 'value', 'said'), REFUSED)
def test_what_does_not_fit_is_refused_in_one_line(wanted: Any, value: Any, said: str):
    with pytest.raises(UserError) as caught:
        check('it', value, wanted)
    assert str(caught.value).startswith('it: got ')
    assert said in str(caught.value)
    assert '\n' not in str(caught.value)


def test_a_long_value_is_cut():
    with pytest.raises(UserError) as caught:
        check('it', 'x' * 10_000, float)
    assert len(str(caught.value)) < 150


def test_a_call_names_function_and_argument_however_it_is_given():
    robot = Robot('flat', seed=3)
    assert (robot.world, robot.seed) == ('flat', 3)
    assert robot.drive(1, turn=2) == (1, 2)
    with pytest.raises(UserError, match='^Robot: seed: got 1.5, wanted a whole number$'):
        Robot(seed=1.5)  # type: ignore[arg-type]
    with pytest.raises(UserError, match="^drive: turn: got 'x', wanted a finite number$"):
        robot.drive(1.0, 'x')  # type: ignore[arg-type]
    with pytest.raises(UserError, match='^drive: turn: got None, wanted a finite number$'):
        robot.drive(1.0, turn=None)  # type: ignore[arg-type]


def test_an_unknown_keyword_is_pythons_own_error():
    with pytest.raises(TypeError, match="unexpected keyword argument 'wrold'"):
        Robot(wrold='flat')  # type: ignore[call-arg]
    with pytest.raises(TypeError, match='missing 1 required positional argument'):
        Robot().drive()  # type: ignore[call-arg]
