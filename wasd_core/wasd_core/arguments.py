# SPDX-License-Identifier: Apache-2.0
"""Arguments of what users call from Python: they are what their annotations say, or refused."""

from collections.abc import Callable, Mapping, Sequence
import functools
import inspect
import math
import numbers
import os
import types
from typing import Any, get_args, get_origin, ParamSpec, TypeVar

from wasd_core.errors import UserError
from wasd_core.parameters import shown

Given = ParamSpec('Given')
Returned = TypeVar('Returned')
# Nouns; another type has its name.
NOUNS: dict[Any, str] = {float: 'finite number', int: 'whole number', str: 'text'}
NOUNS[os.PathLike] = 'path'


def checked(function: Callable[Given, Returned]) -> Callable[Given, Returned]:
    """
    Make a function raise UserError for arguments that do not fit their annotations.

    A number is finite, a text is not empty. A keyword that is unknown or missing is a TypeError,
    as everywhere in Python.
    """
    signature = inspect.signature(function)
    name = function.__qualname__.removesuffix('.__init__').rpartition('.')[2]

    @functools.wraps(function)
    def call(*given: Given.args, **named: Given.kwargs) -> Returned:
        try:
            arguments = signature.bind(*given, **named).arguments
        except TypeError:
            return function(*given, **named)  # which says it better
        for key, value in arguments.items():
            check(f'{name}: {key}', value, signature.parameters[key].annotation)
        return function(*given, **named)

    return call


def check(name: str, value: Any, wanted: Any) -> None:
    """
    Check a value against a type, as `checked` does.

    Raises:
        UserError: it is another.
    """
    if not _fits(value, wanted):
        raise UserError(f'{name}: got {shown(value)}, wanted {_words(wanted)}')


def _fits(value: Any, wanted: Any) -> bool:
    if wanted is float:  # first: most are
        return _is_finite(value)
    kind, parts = get_origin(wanted) or wanted, get_args(wanted)
    if kind in (Any, inspect.Parameter.empty):
        return True
    if kind is types.UnionType:
        return any(_fits(value, part) for part in parts)
    if kind is int:
        return isinstance(value, numbers.Integral) and not isinstance(value, bool)
    if kind is str:
        return isinstance(value, str) and value != ''
    if kind is Mapping:
        return isinstance(value, Mapping) and all(
            each == '' or _fits(each, part)
            for item in value.items()
            for each, part in zip(item, parts, strict=True)
        )
    if kind in (Sequence, tuple):
        return _is_list(value) and _fit_each(value, parts)
    if hasattr(kind, '_fields'):
        types_of = inspect.get_annotations(kind).values()
        return isinstance(value, kind) and all(map(_fits, value, types_of))
    return isinstance(value, kind)


def _fit_each(values: Any, kinds: Sequence[Any]) -> bool:
    if hasattr(values, 'tolist'):  # Python's own numbers are looked at faster
        values = values.tolist()
    if len(kinds) == 1:
        return all(_fits(value, kinds[0]) for value in values)
    return len(values) == len(kinds) and all(map(_fits, values, kinds))


def _is_list(value: Any) -> bool:
    """Whether a value has items in an order, as a tuple or an array of at least one dimension."""
    if isinstance(value, (str, bytes, Mapping)) or getattr(value, 'shape', None) == ():
        return False
    return hasattr(value, '__len__') and hasattr(value, '__getitem__')


def _is_finite(value: Any) -> bool:
    """Whether a value is a number of Python, NumPy or another library."""
    if isinstance(value, (str, bytes, bool, complex)) or getattr(value, 'shape', None):
        return False
    try:
        return math.isfinite(value)
    except (TypeError, ValueError, OverflowError):
        return False


def _words(wanted: Any, plural: str = '') -> str:
    kind, parts = get_origin(wanted) or wanted, get_args(wanted)
    if kind is types.UnionType:
        return ' or '.join(_words(part, plural) for part in parts)
    if kind is Mapping:
        return f'a mapping from {_words(parts[0], "s")} to {_words(parts[1], "s")}'
    if kind in (Sequence, tuple):
        count = len(parts) if len(parts) > 1 else 'a list of'
        return f'{count} {_words(parts[0], "s")}'
    if hasattr(kind, '_fields'):
        each = inspect.get_annotations(kind).items()
        return f'{kind.__name__}({", ".join(f"{name}: {_words(part)}" for name, part in each)})'
    if kind is bool:
        return 'True or False'
    if kind in NOUNS:
        return NOUNS[kind] + plural if plural else f'a {NOUNS[kind]}'
    return 'None' if kind is types.NoneType else str(kind.__name__)
