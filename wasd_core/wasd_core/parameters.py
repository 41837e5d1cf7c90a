# SPDX-License-Identifier: Apache-2.0
"""Parameters as validated data: one frozen definition that code, nodes and documents share."""

from collections.abc import Mapping, Sequence
import dataclasses
import difflib
import math
from typing import Any, Self

from wasd_core.errors import UserError


class InvalidParameter(UserError):
    """A parameter has a value that it cannot have; says the key, what came and what is wanted."""


def parameter(
    default: Any,
    *,
    doc: str,
    unit: str = '',
    above: float | None = None,
    below: float | None = None,
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] = (),
    read_only: bool = False,
    name: str = '',
    nan: str = '',
) -> Any:
    """
    Return the dataclass field of one parameter.

    `above` and `below` exclude their bound, `minimum` and `maximum` include theirs; `choices`
    lists the legal strings. `read_only` parameters are fixed once a node has started. `name` is
    what users call it where that is no Python name (`linear.x.max_velocity`); `nan` says what NaN
    means where it is legal. A tuple makes a list of its items' type, of strings when empty;
    bounds hold for each item.
    """
    return dataclasses.field(
        default=default,
        metadata={
            'doc': doc,
            'unit': unit,
            'above': above,
            'below': below,
            'minimum': minimum,
            'maximum': maximum,
            'choices': choices,
            'read_only': read_only,
            'name': name,
            'nan': nan,
        },
    )


def outward_name(definition: 'dataclasses.Field[Any]') -> str:
    """Return what users call a parameter."""
    return definition.metadata.get('name') or definition.name


@dataclasses.dataclass(frozen=True, kw_only=True)
class Parameters:
    """
    Base of a package's parameter sets; subclasses are frozen dataclasses of `parameter` fields.

    Raises:
        InvalidParameter: on construction, when a value is of the wrong type or out of range.
    """

    def __post_init__(self) -> None:
        """Check every field against its definition; an int is accepted where a float is meant."""
        for definition in dataclasses.fields(self):
            value = _checked(definition, getattr(self, definition.name))
            object.__setattr__(self, definition.name, value)

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> Self:
        """Build from e.g. a YAML mapping; an unknown key is an error that names its neighbour."""
        return cls(**{_find(cls, key).name: value for key, value in values.items()})

    @classmethod
    def checked(cls, key: str, value: Any) -> Any:
        """
        Return the value of one parameter as it would be kept.

        Raises:
            InvalidParameter: there is no such parameter, or it cannot have this value.
        """
        return _checked(_find(cls, key), value)


def _find(definition: type[Parameters], key: str) -> 'dataclasses.Field[Any]':
    known = {outward_name(field): field for field in dataclasses.fields(definition)}
    if key not in known:
        near = difflib.get_close_matches(str(key), known, n=1)
        hint = f', did you mean {near[0]!r}?' if near else f'; known: {", ".join(known)}'
        raise InvalidParameter(f'unknown parameter {key!r}{hint}')
    return known[key]


def _checked(definition: 'dataclasses.Field[Any]', value: Any) -> Any:
    if not isinstance(definition.default, tuple):
        return _checked_item(definition, value, type(definition.default))
    name, default = outward_name(definition), definition.default
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise InvalidParameter(f'{name} must be a list, got {type(value).__name__} {value!r}')
    kind = type(default[0]) if default else str
    if kind is float and len(value) != len(default):
        raise InvalidParameter(f'{name} must be {len(default)} numbers, got {len(value)}')
    return tuple(_checked_item(definition, item, kind) for item in value)


def _checked_item(definition: 'dataclasses.Field[Any]', value: Any, kind: type) -> Any:
    name, meta = outward_name(definition), definition.metadata
    if kind is float and type(value) is int:
        value = float(value)
    if type(value) is not kind:
        raise InvalidParameter(
            f'{name} must be a {kind.__name__}, got {type(value).__name__} {value!r}'
        )
    if meta.get('choices') and value not in meta['choices']:
        wanted = ', '.join(meta['choices'])
        raise InvalidParameter(f'{name} must be one of {wanted}, got {value!r}')
    if isinstance(value, float) and not math.isfinite(value):
        if meta.get('nan') and math.isnan(value):
            return value
        raise InvalidParameter(f'{name} must be a finite number, got {value!r}')
    if isinstance(value, (int, float)) and not _in_range(value, meta):
        raise InvalidParameter(f'{name} must be {describe_range(meta)}, got {value!r}')
    return value


def _in_range(value: float, meta: Mapping[str, Any]) -> bool:
    return (
        (meta.get('above') is None or value > meta['above'])
        and (meta.get('below') is None or value < meta['below'])
        and (meta.get('minimum') is None or value >= meta['minimum'])
        and (meta.get('maximum') is None or value <= meta['maximum'])
    )


def describe_range(meta: Mapping[str, Any]) -> str:
    """Return the legal range of a parameter in words, with its unit."""
    parts = []
    for key, sign in (('above', '>'), ('below', '<'), ('minimum', '>='), ('maximum', '<=')):
        if meta.get(key) is not None:
            parts.append(f'{sign} {meta[key]:g}')
    text = ' and '.join(parts) or 'a number'
    text = f'{text} {meta["unit"]}' if meta.get('unit') else text
    return f'{text}, or NaN: {meta["nan"]}' if meta.get('nan') else text
