# SPDX-License-Identifier: Apache-2.0
"""Gives joints other names, wherever they are named, also where a macro makes the name."""

from collections.abc import Iterator, Mapping
import re
from typing import NamedTuple

from wasd_core.errors import DescriptionError
from wasd_core.safe_files import Place

from robot_description.fix.workspace import Edit
from robot_description.fix.workspace import Workspace
from robot_description.joint_names import meant
from robot_description.lint.model import Element

# Tags whose name or link is that of a link, though a joint may be called the same.
LINK_TAGS = {'link', 'parent', 'child', 'visual', 'collision', 'material'}
PIECE = re.compile(r'\$\{([^}]*)\}|(\$\([^)]*\))|([^$]+|\$)')
NAME = re.compile(r'[A-Za-z_][\w./-]*')


class _Spot(NamedTuple):
    """Where a name stands: an attribute of a tag at a place, or its text."""

    place: Place
    tag: str
    attribute: str | None


def read_renames(texts: list[str]) -> dict[str, str]:
    """
    Return the renames of words `old:=new`.

    Raises:
        DescriptionError: a word is none.
    """
    renames = {}
    for text in texts:
        old, _, new = text.partition(':=')
        if not NAME.fullmatch(old) or not NAME.fullmatch(new):
            raise DescriptionError(f'--rename {text}: wanted OLD:=NEW, two names')
        renames[old] = new
    return renames


def rename_joints(workspace: Workspace, renames: Mapping[str, str]) -> Iterator[Edit]:
    """
    Replace names of joints in the joints themselves and in what refers to them.

    Raises:
        DescriptionError: there is no such joint, or the new name is taken.
    """
    model = workspace.model()
    for old, new in renames.items():
        if old not in model.joints:
            probably = meant(old, model.joints)
            hint = f'; {probably!r} is' if probably else ''
            raise DescriptionError(f'--rename {old}: there is no such joint{hint}')
        if new in model.joints and new not in renames:
            raise DescriptionError(f'--rename {old}:={new}: there is a joint {new!r} already')
    for spot in set(_spots(model.robot, renames)):
        edit = _edit(workspace, spot, renames)
        if edit is not None:
            yield edit


def _spots(robot: Element, renames: Mapping[str, str]) -> Iterator[_Spot]:
    for element in robot.walk():
        if element.tag in LINK_TAGS:
            continue
        for attribute, value in element.attributes.items():
            if value in renames:
                yield _Spot(element.place, element.tag, attribute)
        if element.text in renames:
            yield _Spot(element.place, element.tag, None)


def _edit(workspace: Workspace, spot: _Spot, renames: Mapping[str, str]) -> Edit | None:
    path = spot.place.file
    tag = workspace.tag_at(spot.place, spot.tag)
    if tag is None:  # another package's file
        return None
    data = workspace.sources()[path]
    if spot.attribute is not None:
        span = tag.value_span(data, spot.attribute)
    else:
        span = (tag.end, tag.close) if tag.close is not None else None
    if span is None:
        return None
    text = data[slice(*span)].decode()
    if text.strip() in renames:
        return Edit(path, *span, text.replace(text.strip(), renames[text.strip()]))
    choice = _choice(text, renames)
    if spot.attribute is not None and data[span[0] - 1 : span[0]] == b"'":
        choice = choice.replace("'", '&apos;')
    return Edit(path, *span, choice)


def _choice(text: str, renames: Mapping[str, str]) -> str:
    """
    Return an expression that gives the new names for the old, and what `text` gave for others.

    `${side}_wheel` becomes `${'l_wheel' if str(side) + '_wheel' == 'left_wheel' else ...}`.
    """
    pieces = []
    for expression, substitution, literal in PIECE.findall(text.strip()):
        if expression:
            pieces.append(f'str({expression})')
        elif substitution or literal:
            pieces.append(f"'{substitution or literal}'")
    made = ' + '.join(pieces)
    choices = ''.join(f"'{new}' if {made} == '{old}' else " for old, new in renames.items())
    return f'${{{choices}{made}}}'
