# SPDX-License-Identifier: Apache-2.0
"""The fixes: each yields the edits that mend one kind of finding, in the text of the files."""

from collections.abc import Iterator, Mapping
import itertools
from pathlib import Path
import re
from xml.sax.saxutils import escape

from wasd_core.errors import DescriptionError
from wasd_core.safe_files import Place

from robot_description.fix.workspace import Edit, Workspace
from robot_description.lint.geometry import find_wheels, FOOTPRINT, swapped_pairs
from robot_description.lint.model import Element, Model
from robot_description.lint.structure import JOINT_TAGS
from robot_description.morphology.names import hint_at, OPPOSITE, sides
from robot_description.xacro.source import PREFIX, SourceTag, unprefixed_calls

QUOTES = {'"': '&quot;', "'": '&apos;'}
TEXT = """{indent}<link name="{footprint}"/>
{indent}<joint name="{joint}" type="fixed">
{indent}  <origin xyz="0 0 {height:.6g}" rpy="0 0 0"/>
{indent}  <parent link="{footprint}"/>
{indent}  <child link="{root}"/>
{indent}</joint>
"""
# A number, or an expression of xacro, in a list of numbers.
COMPONENT = re.compile(rb'(?:\$\{[^}]*\}|\$\([^)]*\)|[^\s$])+')
# Tags whose name or link is that of a link, though a joint may be called the same.
LINK_TAGS = {'link', 'parent', 'child', 'visual', 'collision', 'material'}
# Tags with their attributes, or None for their text, that name a joint though a link has its name.
JOINT_PLACES = {('joint', 'name'), ('mimic', 'joint'), *((tag, None) for tag in JOINT_TAGS)}
PIECE = re.compile(r'\$\{([^}]*)\}|(\$\([^)]*\))|([^$]+|\$)')
NAME = re.compile(r'[A-Za-z_][\w./-]*')


def prefix_macros(workspace: Workspace) -> Iterator[Edit]:
    """Write `xacro:` before macro calls that lack it."""
    own = workspace.sources()
    for path, tag in unprefixed_calls(workspace.texts()):
        if path not in own:
            continue
        yield Edit(path, tag.start + 1, tag.start + 1, PREFIX)
        if tag.close is not None:
            yield Edit(path, tag.close + 2, tag.close + 2, PREFIX)


def drop_materials(workspace: Workspace) -> Iterator[Edit]:
    """Leave the first of several materials of a visual."""
    for path, data in workspace.sources().items():
        for visual in workspace.tags(path).walk():
            if visual.name == 'visual':
                materials = [child for child in visual.children if child.name == 'material']
                for material in materials[1:]:
                    yield _without(path, data, material)


def _without(path: Path, data: bytes, tag: SourceTag) -> Edit:
    """Take out an element, with its line when nothing else stands there."""
    start = tag.start
    end = tag.end if tag.close is None else data.index(b'>', tag.close) + 1
    line_start = data.rfind(b'\n', 0, start) + 1
    line_end = data.find(b'\n', end) + 1
    is_alone = not data[line_start:start].strip() and not data[end:line_end].strip()
    if is_alone and line_start and line_end:
        start, end = line_start, line_end
    return Edit(path, start, end, '')


def correct_mesh_paths(workspace: Workspace) -> Iterator[Edit]:
    """Replace the paths that are good here only, or not at all, where they are written out."""
    records = {record.url: record for record in workspace.meshes().records}
    for path, data in workspace.sources().items():
        for tag in workspace.tags(path).walk():
            span = tag.value_span(data, 'filename') if tag.name == 'mesh' else None
            if span is None:
                continue
            written = tag.attributes['filename']
            record = records.get(url := workspace.with_folders(written))
            if record is None or record.better is None or record.is_exact and url != written:
                continue
            yield Edit(path, *span, escape(record.better, QUOTES))


def add_footprint(workspace: Workspace) -> Iterator[Edit]:
    """Add the link and the joint to the root, at the height of the wheels' lowest point."""
    model = workspace.model()
    robot = workspace.tags(workspace.path)
    if robot.close is None:
        return
    data = workspace.sources()[workspace.path]
    line_start = data.rfind(b'\n', 0, robot.close) + 1
    is_alone = not data[line_start : robot.close].strip()
    at = line_start if is_alone else robot.close
    before = data[: robot.children[0].start].rpartition(b'\n')[2].decode()
    indent = '  ' if before.strip() else before
    # How far below the root the wheels touch the ground [m].
    height = max(wheel.radius - wheel.z for wheel in find_wheels(model))
    root = escape(next(link for link in model.links if link not in model.joint_above), QUOTES)
    joint = f'{FOOTPRINT}_joint'
    while joint in model.joints:
        joint += '_'
    text = TEXT.format(indent=indent, footprint=FOOTPRINT, joint=joint, height=height, root=root)
    text = text if is_alone else '\n' + text
    if data[:line_start].endswith(b'\r\n'):
        text = text.replace('\n', '\r\n')
    yield Edit(workspace.path, at, at, text)


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
            hint = hint_at(old, model.joints)
            raise DescriptionError(f'--rename {old}: there is no such joint{hint}')
        if new in model.joints and new not in renames:
            raise DescriptionError(f'--rename {old}:={new}: there is a joint {new!r} already')
    for place, tag, attribute in set(_spots(model, renames)):
        edit = _edit(workspace, workspace.tag_at(place, tag), attribute, place.file, renames)
        if edit is not None:
            yield edit


def _spots(model: Model, renames: Mapping[str, str]) -> Iterator[tuple[Place, str, str | None]]:
    """Yield where a name stands: an attribute of a tag at a place, or its text."""
    for element in model.robot.walk():
        if element.tag in LINK_TAGS:
            continue
        for attribute, name in [*element.attributes.items(), (None, element.text)]:
            is_joint = name not in model.links or (element.tag, attribute) in JOINT_PLACES
            if name in renames and is_joint:
                yield element.place, element.tag, attribute


def _edit(
    workspace: Workspace,
    tag: SourceTag | None,
    attribute: str | None,
    path: Path,
    renames: Mapping[str, str],
) -> Edit | None:
    if tag is None:  # another package's file
        return None
    data = workspace.sources()[path]
    if attribute is not None:
        span = tag.value_span(data, attribute)
    else:
        span = (tag.end, tag.close) if tag.close is not None else None
    if span is None:
        return None
    text = data[slice(*span)].decode()
    if text.strip() in renames:
        return Edit(path, *span, text.replace(text.strip(), renames[text.strip()]))
    choice = _choice(text, renames)
    if attribute is not None and data[span[0] - 1 : span[0]] == b"'":
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
