# SPDX-License-Identifier: Apache-2.0
"""Puts left to the left and front to the front, where they were exchanged."""

from collections.abc import Iterator
import itertools
import re

from robot_description.fix.workspace import Edit
from robot_description.fix.workspace import Workspace
from robot_description.joint_names import OPPOSITE
from robot_description.joint_names import sides
from robot_description.lint.model import Element
from robot_description.lint.sides import swapped_pairs
from robot_description.macro_calls import PREFIX
from robot_description.source_xml import SourceTag

# A number, or an expression of xacro, in a list of numbers.
COMPONENT = re.compile(rb'(?:\$\{[^}]*\}|\$\([^)]*\)|[^\s$])+')


def swap_sides(workspace: Workspace, side: str) -> Iterator[Edit]:
    """
    Exchange what makes a joint on `side` (`left` or `front`) differ from its counterpart.

    That is y (or x) of their origins; where one macro makes both, the arguments of its calls that
    are each other's negative.
    """
    for one, other in swapped_pairs(workspace.model(), side):
        if one.place != other.place:
            yield from _swap_origins(workspace, one, other, 1 if side == 'left' else 0)
        else:
            yield from _swap_calls(workspace, one.name, other.name, side)


def _swap_origins(workspace: Workspace, one: Element, other: Element, axis: int) -> Iterator[Edit]:
    spans = []
    for joint in (one, other):
        origin = joint.find('origin')
        tag = workspace.tag_at(origin.place, 'origin') if origin else None
        if origin is None or tag is None:
            return
        data = workspace.sources()[origin.place.file]
        span = tag.value_span(data, 'xyz')
        parts = list(COMPONENT.finditer(data, *span)) if span else []
        if len(parts) != 3:
            return
        spans.append((origin.place.file, parts[axis]))
    for (path, here), (_, there) in (spans, spans[::-1]):
        yield Edit(path, here.start(), here.end(), there[0].decode())


def _swap_calls(workspace: Workspace, one: str, other: str, side: str) -> Iterator[Edit]:
    """Exchange arguments between the calls of a macro for one side and for the other."""
    for path, data in workspace.sources().items():
        for parent in workspace.tags(path).walk():
            calls = [tag for tag in parent.children if tag.name.startswith(PREFIX)]
            for here, there in itertools.combinations(calls, 2):
                if here.name != there.name or not _are_sides(here, there, side, (one, other)):
                    continue
                for name in here.attributes:
                    if _is_negative(here.attributes[name], there.attributes.get(name, '')):
                        for tag, mate in ((here, there), (there, here)):
                            span, other_span = (t.value_span(data, name) for t in (tag, mate))
                            if span is not None and other_span is not None:
                                yield Edit(path, *span, data[slice(*other_span)].decode())


def _are_sides(here: SourceTag, there: SourceTag, side: str, joints: tuple[str, str]) -> bool:
    """Whether an argument says `left` in one call and `right` in the other, as the joints do."""
    for name, value in here.attributes.items():
        values = (value, there.attributes.get(name, ''))
        told = {frozenset(sides(text)) & {side, OPPOSITE[side]} for text in values}
        if told == {frozenset({side}), frozenset({OPPOSITE[side]})} and all(
            any(text in joint for joint in joints) for text in values
        ):
            return True
    return False


def _is_negative(one: str, other: str) -> bool:
    try:
        return float(one) == -float(other) != 0.0
    except ValueError:
        return bool(one) and other.replace(' ', '') in (f'-{one}', one.removeprefix('-'))
