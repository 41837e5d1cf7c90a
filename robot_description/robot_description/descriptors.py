# SPDX-License-Identifier: Apache-2.0
"""Parameter definitions as ROS tools see them: meaning, range, choices, read-only or not."""

import dataclasses
from typing import Any

from rcl_interfaces.msg import FloatingPointRange
from rcl_interfaces.msg import IntegerRange
from rcl_interfaces.msg import ParameterDescriptor

from robot_description.parameters import describe_range


def to_descriptor(field: 'dataclasses.Field[Any]') -> ParameterDescriptor:
    """
    Return the descriptor of a `parameter` field.

    ROS' ranges have two ends that belong to them, and no NaN; where ours have not, the range is
    said in words, and our own check alone refuses what is outside.
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
    if is_float and None not in ends and not meta['nan']:
        limits = FloatingPointRange(from_value=float(ends[0]), to_value=float(ends[1]))
        descriptor.floating_point_range = [limits]
    elif is_integer and None not in ends:
        descriptor.integer_range = [IntegerRange(from_value=ends[0], to_value=ends[1], step=1)]
    return descriptor
