# SPDX-License-Identifier: Apache-2.0
"""Parameters as validated data: one frozen definition that code, nodes and documents share."""

from collections.abc import Collection, Mapping, Sequence
import dataclasses
import functools
import math
import operator
from types import MappingProxyType
from typing import Any, ClassVar, dataclass_transform, NamedTuple, Self, TypeVar

from wasd_core.errors import suggest, UserError

# The ends of a range, how they are written and compared.
BOUNDS = {
    'above': ('>', operator.gt),
    'minimum': ('>=', operator.ge),
    'maximum': ('<=', operator.le),
}
WORDS = {bool: 'true or false', int: 'a whole number', float: 'a number', str: 'a text'}

# Of an integer, what a float can be; of what errors show, the characters.
LARGEST, LONGEST_SHOWN = 10**300, 80


class InvalidParameter(UserError):
    """A parameter has an invalid value; gives the key, the value and what is wanted."""


def parameter(
    default: Any,
    *,
    doc: str,
    unit: str = '',
    above: float | None = None,
    minimum: float | None = None,
    maximum: float | None = None,
    span: tuple[Any, Any] | None = None,
    choices: Collection[str] = (),
    read_only: bool = False,
    name: str = '',
    nan: str = '',
    or_zero: bool = False,
) -> Any:
    """
    Return the dataclass field of one parameter.

    `above` excludes its bound, `minimum` and `maximum` include theirs; `choices` lists the legal
    strings. `read_only` parameters are fixed once a node has started. `name` is what users call
    it where that is no Python name (`linear.x.max_velocity`); `nan` says what NaN means where it
    is legal; `or_zero` allows 0 below the minimum, with a meaning of its own. A tuple makes a list
    of its items' type, of strings when empty; bounds hold for each item.

    What people give (a file, ROS) must lie in the `span`, of which both ends belong to it and are
    tuples for a list; without one, within the bounds. Code may go beyond it, as far as the bounds:
    another robot's numbers are others.
    """
    return dataclasses.field(
        default=default,
        metadata={
            'doc': doc,
            'unit': unit,
            'above': above,
            'minimum': minimum,
            'maximum': maximum,
            'span': span,
            'choices': choices,
            'read_only': read_only,
            'name': name,
            'nan': nan,
            'or_zero': or_zero,
        },
    )


# A parameter that is fixed once a node has started.
fixed = functools.partial(parameter, read_only=True)


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


def known_parameters(definition: 'type[Parameters]') -> Mapping[str, Known]:
    """
    Return every parameter of a set by what users call it, those of its groups last.

    A field of a group is called `group.field`, unless it has a `name` of its own.
    """
    if definition not in _known:  # a start asks some hundred times
        _known[definition] = MappingProxyType(_list_parameters(definition))
    return _known[definition]


_known: dict[type, Mapping[str, Known]] = {}


def _list_parameters(definition: 'type[Parameters]') -> dict[str, Known]:
    fields = dataclasses.fields(definition)
    known = {outward_name(field): Known(field) for field in fields if not _is_group(field)}
    for part in filter(_is_group, fields):
        for field in dataclasses.fields(part.metadata['group']):
            name = field.metadata['name'] or f'{part.name}.{field.name}'
            known[name] = Known(field, part.name)
    return known


def _is_group(field: 'dataclasses.Field[Any]') -> bool:
    return 'group' in field.metadata


# Without methods that are compiled for each set: they would take a start tens of milliseconds.
_parameter_set = dataclasses.dataclass(init=False, repr=False, eq=False)


@dataclass_transform(frozen_default=True, kw_only_default=True)
@_parameter_set
class Parameters:
    """
    Base of a package's parameter sets: a subclass becomes a dataclass that cannot be changed.

    Its fields are made by `parameter`, `fixed` and `group`. `__post_init__` may check further.

    Raises:
        InvalidParameter: on construction, when a value is of the wrong type or out of range.
    """

    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]

    def __init_subclass__(cls) -> None:
        """Make a dataclass of each subclass."""
        super().__init_subclass__()
        _parameter_set(cls)

    def __init__(self, **values: Any) -> None:
        """Take values by the names of their fields; the others have their defaults."""
        for field in dataclasses.fields(self):
            if field.name in values:
                value = values.pop(field.name)
            elif _is_group(field):
                value = field.metadata['group']()
            else:
                value = field.default
            object.__setattr__(self, field.name, value)
        if values:
            raise TypeError(f'{type(self).__name__} has no {", ".join(map(repr, values))}')
        self.__post_init__()

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse: a set is frozen."""
        raise dataclasses.FrozenInstanceError(f'cannot assign to field {name!r}')

    def __delattr__(self, name: str) -> None:
        """Refuse: a set is frozen."""
        raise dataclasses.FrozenInstanceError(f'cannot delete field {name!r}')

    def _values(self) -> tuple[Any, ...]:
        return tuple(getattr(self, field.name) for field in dataclasses.fields(self))

    def __eq__(self, other: object) -> bool:
        """Return whether the other is of the same class and has the same values."""
        if type(other) is not type(self):
            return NotImplemented
        return self._values() == other._values()

    def __hash__(self) -> int:
        """Return a hash of all values."""
        return hash(self._values())

    def __repr__(self) -> str:
        """Return the call that makes this set."""
        fields = zip(dataclasses.fields(self), self._values(), strict=True)
        return f'{type(self).__qualname__}({", ".join(f"{f.name}={v!r}" for f, v in fields)})'

    def __post_init__(self) -> None:
        """Check every field against its definition; an int is accepted where a float is meant."""
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if _is_group(field):
                wanted = field.metadata['group']
                if not isinstance(value, wanted):
                    raise InvalidParameter(f'{field.name} must be {wanted.__name__}')
            elif value is not field.default:
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
            kept[field.name] = _checked(field, value, key, is_given=True)
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
        return _checked(_find(cls, key).field, value, key, is_given=True)


ParametersType = TypeVar('ParametersType', bound=Parameters)


def _find(definition: type[Parameters], key: str) -> Known:
    known = known_parameters(definition)
    if key not in known:
        raise InvalidParameter(f'unknown parameter {key!r}{suggest(str(key), known)}')
    return known[key]


def _checked(
    definition: 'dataclasses.Field[Any]', value: Any, name: str, *, is_given: bool = False
) -> Any:
    """Return a value as it is kept; `name` is what errors call it, `is_given` says by people."""
    default, meta = definition.default, definition.metadata
    if not isinstance(default, tuple):
        return _checked_item(as_given(meta) if is_given else meta, value, type(default), name)
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise InvalidParameter(f'{name} must be a list, got {shown(value)}')
    kind = type(default[0]) if default else str
    if kind is float and len(value) != len(default):
        raise InvalidParameter(f'{name} must be {len(default)} numbers, got {len(value)}')
    if not (is_given and meta.get('span')):
        return tuple(_checked_item(meta, item, kind, name) for item in value)
    return tuple(
        _checked_item(as_given(meta, index), item, kind, f'{name}[{index}]')
        for index, item in enumerate(value)
    )


def as_given(meta: Mapping[str, Any], index: int | None = None) -> Mapping[str, Any]:
    """Return a definition with its span, or that of one item of a list, in place of its bounds."""
    if meta.get('span') is None:
        return meta
    low, high = meta['span'] if index is None else (end[index] for end in meta['span'])
    return {**meta, 'above': None, 'minimum': low, 'maximum': high}


def _checked_item(meta: Mapping[str, Any], value: Any, kind: type, name: str) -> Any:
    if kind is float and type(value) is int and abs(value) < LARGEST:
        value = float(value)
    if type(value) is not kind:
        raise InvalidParameter(f'{name} must be {WORDS[kind]}, got {shown(value)}')
    # The names of some files are no text.
    if isinstance(value, str) and value.encode(errors='replace').decode() != value:
        got = f'got {shown(value)}: choose another name'
        raise InvalidParameter(f'{name} must be text in UTF-8, as ROS has no other, {got}')
    if meta.get('choices') and value not in meta['choices']:
        wanted = ', '.join(meta['choices'])
        raise InvalidParameter(f'{name} must be one of {wanted}, got {shown(value)}')
    if isinstance(value, float) and not math.isfinite(value):
        if meta.get('nan') and math.isnan(value):
            return value
        raise InvalidParameter(f'{name} must be a finite number, got {value!r}')
    if isinstance(value, (int, float)) and not _in_range(value, meta):
        raise InvalidParameter(f'{name} must be {describe_range(meta)}, got {shown(value)}')
    return value


def _in_range(value: float, meta: Mapping[str, Any]) -> bool:
    if meta.get('or_zero') and value == 0.0:
        return True
    given = ((fits, meta.get(key)) for key, (_, fits) in BOUNDS.items())
    return all(bound is None or fits(value, bound) for fits, bound in given)


def shown(value: Any) -> str:
    """Return a value as errors show it: on one line that is not too long."""
    try:
        text = repr(value)
    except ValueError:  # Python writes out no number of more than 4300 digits
        return 'a number of thousands of digits'
    if '\n' in text:  # an array
        text = ' '.join(text.split())
    return text if len(text) <= LONGEST_SHOWN else f'{text[: LONGEST_SHOWN - 3]}...'


def numeric_ends(field: 'dataclasses.Field[Any]') -> tuple[Any, Any]:
    """
    Return the smallest and the largest number that people may give, tuples for a list of numbers.

    An open end is infinite. An excluded bound gives the next number inside. With `or_zero` a
    minimum counts as 0.
    """
    meta = as_given(field.metadata)
    low, high = meta['minimum'], meta['maximum']
    low = -math.inf if low is None else 0.0 if meta['or_zero'] else low
    high = math.inf if high is None else high
    if meta['above'] is not None:
        low = math.nextafter(meta['above'], math.inf)
    if isinstance(field.default, tuple) and meta.get('span') is None:
        return (low,) * len(field.default), (high,) * len(field.default)
    return low, high


def _plain(bound: float | tuple[float, ...]) -> str:
    """Return a bound in words, those of each item of a list in brackets."""
    if isinstance(bound, tuple):
        return f'[{", ".join(map(_plain, bound))}]'
    # As it is: a number that is rounded would be another.
    return f'{bound:g}' if float(f'{bound:g}') == bound else repr(bound)


def describe_range(meta: Mapping[str, Any]) -> str:
    """Return the legal range of a parameter in words, with its unit."""
    given = ((sign, meta.get(key)) for key, (sign, _) in BOUNDS.items())
    parts = [f'{sign} {_plain(bound)}' for sign, bound in given if bound is not None]
    text = ' and '.join(parts) or 'a number'
    text = f'{text} {meta["unit"]}' if meta.get('unit') else text
    text = f'0, or {text}' if meta.get('or_zero') else text
    return f'{text}, or NaN: {meta["nan"]}' if meta.get('nan') else text
