# SPDX-License-Identifier: Apache-2.0
"""Parameter definitions as ROS tools see them: meaning, range, choices, read-only or not."""

from collections.abc import Mapping
import dataclasses
import math
from typing import Any

from rcl_interfaces.msg import FloatingPointRange
from rcl_interfaces.msg import IntegerRange
from rcl_interfaces.msg import ParameterDescriptor

from wasd_core.parameters import describe_range


def to_descriptor(field: 'dataclasses.Field[Any]') -> ParameterDescriptor:
    """
    Return the descriptor of a `parameter` field.

    ROS' ranges have two ends that belong to them: an excluded end of a float is the next number
    inside, an open one infinity. They have no NaN: where that is legal, and for integers with an
    open end, the range is said in words alone, and our own check refuses what is outside.
    """
    meta = field.metadata
    is_float, is_integer = isinstance(field.default, float), type(field.default) is int
    description, constraints = meta['doc'], ', '.join(meta['choices'])
    if is_float or is_integer:
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
        low, high = _float_ends(meta)
        if math.isfinite(low) or math.isfinite(high):
            descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    elif is_integer and None not in ends:
        descriptor.integer_range = [IntegerRange(from_value=ends[0], to_value=ends[1], step=1)]
    return descriptor


def _float_ends(meta: Mapping[str, Any]) -> tuple[float, float]:
    """Return the smallest and the largest legal number."""
    low = high = None
    if meta['above'] is not None:
        low = math.nextafter(meta['above'], math.inf)
    if meta['below'] is not None:
        high = math.nextafter(meta['below'], -math.inf)
    low = meta['minimum'] if low is None else low
    high = meta['maximum'] if high is None else high
    return (
        -math.inf if low is None else float(low),
        math.inf if high is None else float(high),
    )
