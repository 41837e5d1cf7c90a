# SPDX-License-Identifier: Apache-2.0
"""Parameters as validated data: one frozen definition that code, nodes and documents share."""

from collections.abc import Collection, Mapping, Sequence
import dataclasses
import math
from typing import Any, NamedTuple, Self

from wasd_core.errors import suggest
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
    choices: Collection[str] = (),
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


def group(definition: 'type[Parameters]') -> Any:
    """Return the dataclass field of a set within a set: `period` of `gait` is `gait.period`."""
    return dataclasses.field(default_factory=definition, metadata={'group': definition})


def outward_name(definition: 'dataclasses.Field[Any]') -> str:
    """Return what users call a parameter."""
    return definition.metadata.get('name') or definition.name


class Known(NamedTuple):
    """Where a parameter is: its field, and the group that has it, '' for the set itself."""

    field: 'dataclasses.Field[Any]'
    group: str = ''


def known_parameters(definition: 'type[Parameters]') -> dict[str, Known]:
    """
    Return every parameter of a set by what users call it, those of its groups last.

    A field of a group is called `group.field`, unless it has a `name` of its own.
    """
    fields = dataclasses.fields(definition)
    known = {outward_name(field): Known(field) for field in fields if not _is_group(field)}
    for part in filter(_is_group, fields):
        for field in dataclasses.fields(part.metadata['group']):
            name = field.metadata['name'] or f'{part.name}.{field.name}'
            known[name] = Known(field, part.name)
    return known


def _is_group(field: 'dataclasses.Field[Any]') -> bool:
    return 'group' in field.metadata


@dataclasses.dataclass(frozen=True, kw_only=True)
class Parameters:
    """
    Base of a package's parameter sets: frozen dataclasses of `parameter` and `group` fields.

    Raises:
        InvalidParameter: on construction, when a value is of the wrong type or out of range.
    """

    def __post_init__(self) -> None:
        """Check every field against its definition; an int is accepted where a float is meant."""
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if _is_group(field):
                wanted = field.metadata['group']
                if not isinstance(value, wanted):
                    raise InvalidParameter(f'{field.name} must be {wanted.__name__}')
            else:
                object.__setattr__(self, field.name, _checked(field, value, outward_name(field)))

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> Self:
        """Build from e.g. a YAML mapping; an unknown key is an error that names its neighbour."""
        return cls().changed(values)

    def changed(self, values: Mapping[str, Any]) -> Self:
        """
        Return this set with other values, by the names that users call them.

        Raises:
            InvalidParameter: one is unknown, or cannot have its value.
        """
        own: dict[str, Any] = {}
        groups: dict[str, dict[str, Any]] = {}
        for key, value in values.items():
            field, part = _find(type(self), key)
            kept = groups.setdefault(part, {}) if part else own
            kept[field.name] = _checked(field, value, key)
        for part, inner in groups.items():
            own[part] = dataclasses.replace(getattr(self, part), **inner)
        return dataclasses.replace(self, **own)

    def value(self, key: str) -> Any:
        """Return the value of one parameter, by the name that users call it."""
        field, part = _find(type(self), key)
        return getattr(getattr(self, part) if part else self, field.name)

    @classmethod
    def checked(cls, key: str, value: Any) -> Any:
        """
        Return the value of one parameter as it would be kept.

        Raises:
            InvalidParameter: there is no such parameter, or it cannot have this value.
        """
        return _checked(_find(cls, key).field, value, key)


def _find(definition: type[Parameters], key: str) -> Known:
    known = known_parameters(definition)
    if key not in known:
        raise InvalidParameter(f'unknown parameter {key!r}{suggest(str(key), known)}')
    return known[key]


def _checked(definition: 'dataclasses.Field[Any]', value: Any, name: str) -> Any:
    """Return a value as it is kept; `name` is what errors call it."""
    default = definition.default
    if not isinstance(default, tuple):
        return _checked_item(definition, value, type(default), name)
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise InvalidParameter(f'{name} must be a list, got {type(value).__name__} {value!r}')
    kind = type(default[0]) if default else str
    if kind is float and len(value) != len(default):
        raise InvalidParameter(f'{name} must be {len(default)} numbers, got {len(value)}')
    return tuple(_checked_item(definition, item, kind, name) for item in value)


def _checked_item(definition: 'dataclasses.Field[Any]', value: Any, kind: type, name: str) -> Any:
    meta = definition.metadata
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
