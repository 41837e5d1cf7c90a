# SPDX-License-Identifier: Apache-2.0
"""Numbers in the attributes of a URDF."""

import math
import xml.etree.ElementTree as ElementTree

import numpy as np
from wasd_core.errors import DescriptionError


def read_numbers(
    tag: ElementTree.Element | None, attribute: str, default: str, where: str
) -> np.ndarray:
    """
    Return an attribute's numbers, as many as its default has.

    Raises:
        DescriptionError: see `parse_numbers`.
    """
    text = tag.get(attribute, default) if tag is not None else default
    return parse_numbers(text, len(default.split()), f'{where}: {attribute}')


def parse_numbers(text: str, count: int, where: str) -> np.ndarray:
    """
    Return `count` finite numbers.

    Raises:
        DescriptionError: says where they were wanted, and what was there.
    """
    try:
        numbers = np.array([float(number) for number in text.split()])
    except ValueError:
        numbers = np.array([math.nan])
    if len(numbers) != count or not np.isfinite(numbers).all():
        wanted = 'a number' if count == 1 else f'{count} numbers'
        raise DescriptionError(f'{where} needs {wanted}, got {text!r}')
    return numbers
