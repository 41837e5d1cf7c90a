# SPDX-License-Identifier: Apache-2.0
"""ROS parameters: declares definitions on a node, with descriptions for ROS tools."""

import array
from collections.abc import Callable, Mapping, Sequence
import dataclasses
import functools
import itertools
import math
from types import MethodType
from typing import Any, cast
from weakref import WeakMethod

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter

from wasd_core.errors import did_you_mean
from wasd_core.parameters import (
    as_given,
    describe_range,
    InvalidParameter,
    Known,
    known_parameters,
    numeric_ends,
    Parameters,
    ParametersType,
)


def to_descriptor(field: 'dataclasses.Field[Any]') -> ParameterDescriptor:
    """
    Return the descriptor of a `parameter` field.

    ROS' ranges have two ends that belong to them: an excluded end of a float is the next number
    inside, an open one infinity. They have no NaN and none of a list: there, and for integers
    with an open end, the range is said in words alone, and our own check refuses what is outside.
    """
    meta = as_given(field.metadata)
    is_float, is_integer = isinstance(field.default, float), type(field.default) is int
    items = field.default if isinstance(field.default, tuple) else ()
    description, constraints = meta['doc'], ', '.join(meta['choices'])
    if is_float or is_integer or float in map(type, items):
        constraints = describe_range(meta)
        description += f' (float, {constraints})' if is_float else f' ({constraints})'
    descriptor = ParameterDescriptor(
        description=description,
        read_only=meta['read_only'],
        # So that ROS lets integers through to our own check, which knows what they mean.
        # An empty list has no type yet.
        dynamic_typing=is_float or isinstance(field.default, tuple),
        additional_constraints=constraints,
    )
    ends = meta['minimum'], meta['maximum']
    if is_float and not meta['nan']:
        low, high = map(float, numeric_ends(field))
        if math.isfinite(low) or math.isfinite(high):
            descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    elif is_integer and None not in ends:
        descriptor.integer_range = [IntegerRange(from_value=ends[0], to_value=ends[1], step=1)]
    return descriptor


def declare_parameters(
    node: Node,
    definition: type[ParametersType],
    on_change: Callable[[ParametersType], None] | None = None,
    defaults: ParametersType | None = None,
) -> ParametersType:
    """
    Declare a parameter set on a node and return its values; `defaults` replaces the definition's.

    With `on_change`, parameters that are not read-only can be set at run time: a legal change
    calls it with the new set, an illegal one is rejected with the reason. An integer is taken
    where a float is meant: people write `speed:=2`.

    Raises:
        InvalidParameter: when an override given at start is illegal.
    """
    values: dict[str, Any] = {}
    before = definition() if defaults is None else defaults
    known = known_parameters(definition)
    try:
        _refuse_unknown(node, definition, known)
        for name, (field, _) in known.items():
            given = node._parameter_overrides.get(name)
            if given is not None and _is_plain({type(field.default), type(given.value)}):
                # ROS would say less of a range, and breaks on text that is no UTF-8.
                definition.checked(name, given.value)
            default = before.value(name)
            value = list(default) if isinstance(default, tuple) else default
            declared = node.declare_parameter(name, value, to_descriptor(field))
            values[name] = _from_ros(declared.value)
        current = before.changed(values)
    except (InvalidParameter, rclpy.exceptions.ParameterException) as error:
        raise InvalidParameter(f'{node.get_name()}: {error}') from None
    _take_changes(node, current, known, on_change)
    return current


def _is_plain(kinds: set[type]) -> bool:
    """Whether a default and a value of these kinds are numbers, or text."""
    return kinds <= {int, float} or kinds == {str}


def misspelt_parameters(*nodes: Node) -> list[str]:
    """
    Return what to say of parameters that were given to nodes of one process, which none has.

    Only those that are nearly one of theirs: a file for all nodes has some of others. A node may
    have `other_names` of its parameters.
    """
    known = [(*node._parameters, *getattr(node, 'other_names', ())) for node in nodes]
    own = set(itertools.chain(*known))
    given = {name for node in nodes for name in node._parameter_overrides}
    hints = {name: did_you_mean(name, own) for name in sorted(given - own)}
    return [f'unknown parameter {name!r}{hint}: ignored' for name, hint in hints.items() if hint]


def vain_parameters(*nodes: Node) -> list[str]:
    """Return those given to one process that have another value in each node that has them."""
    is_so: dict[str, bool] = {}
    for node in nodes:
        # Without those that the node itself was made with.
        for name, given in node.handle.get_parameters(Parameter).items():
            if node.has_parameter(name):
                value = node.get_parameter(name).value
                same = value == given.value or str(value) == str(given.value)  # NaN
                is_so[name] = is_so.get(name, False) or same
    return [name for name, is_in_force in is_so.items() if not is_in_force]


def _take_changes(
    node: Node,
    current: ParametersType,
    known: Mapping[str, Known],
    on_change: Callable[[ParametersType], None] | None,
) -> None:
    """Check changes at run time against the current set, and tell of them."""
    # A node that its own method holds would stay, with all it has, until garbage is collected.
    is_own = isinstance(on_change, MethodType) and on_change.__self__ is node
    listener = WeakMethod(cast(MethodType, on_change)) if is_own else lambda: on_change

    def set_parameters(changes: 'Sequence[Parameter]', tells: bool = False) -> SetParametersResult:
        nonlocal current
        wanted = {
            change.name: _from_ros(change.value) for change in changes if change.name in known
        }
        if not wanted:
            return SetParametersResult(successful=True)
        try:
            changed = current.changed(wanted)
            tell = listener() if tells else None
            if tell is not None:
                tell(changed)
        except (InvalidParameter, TypeError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        if tells:
            current = changed
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(set_parameters)
    # After the checks of all sets of a node: where one refuses, none changes.
    node._on_set_parameters_callbacks.append(functools.partial(set_parameters, tells=True))


def _refuse_unknown(node: Node, definition: type[Parameters], known: Mapping[str, Known]) -> None:
    """Refuse `group.x` where the group has no x; other names may be meant for others."""
    groups = {place.group for place in known.values()} - {''}
    for name in node._parameter_overrides:
        if '.' in name and name.partition('.')[0] in groups and name not in known:
            definition.from_mapping({name: None})


def _from_ros(value: Any) -> Any:
    """Return a list of any of ROS's kinds as a tuple."""
    return tuple(value) if isinstance(value, (list, array.array)) else value
