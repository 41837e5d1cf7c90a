# SPDX-License-Identifier: Apache-2.0
"""The type of a message's field, as `get_fields_and_field_types` of its class writes it."""

from functools import cache
import re
from typing import NamedTuple

_SEQUENCE = re.compile(r'sequence<(?P<item>[^,]+?)(?:, \d+)?>')
_ARRAY = re.compile(r'(?P<item>.+)\[(?P<length>\d+)\]')
_NESTED = re.compile(r'\w+/\w+')


class FieldType(NamedTuple):
    """A primitive, a string or a message `package/Name`, alone or several of them."""

    item: str
    is_sequence: bool = False
    length: int | None = None  # of an array

    @property
    def is_single(self) -> bool:
        """Whether it is one item."""
        return not self.is_sequence and self.length is None

    @property
    def is_message(self) -> bool:
        """Whether the items are messages themselves."""
        return _NESTED.fullmatch(self.item) is not None

    @property
    def is_string(self) -> bool:
        """Whether the items are strings."""
        return self.item.startswith(('string', 'wstring'))


@cache
def parse_field_type(text: str) -> FieldType:
    """Return what a text such as `double[36]` or `sequence<std_msgs/Header, 3>` says."""
    if (match := _SEQUENCE.fullmatch(text)) is not None:
        return FieldType(match['item'], is_sequence=True)
    if (match := _ARRAY.fullmatch(text)) is not None:
        return FieldType(match['item'], length=int(match['length']))
    return FieldType(text)
