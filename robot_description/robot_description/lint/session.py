# SPDX-License-Identifier: Apache-2.0
"""Says what is wrong with a description, where, and how to cure it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

from wasd_core.errors import DescriptionError
from wasd_core.safe_files import LocatedError, Place

from robot_description.lint import geometry, sensors, structure
from robot_description.lint.model import Model, to_element
from robot_description.lint.rules import Finding, finding
from robot_description.meshes.opening import open_meshes
from robot_description.meshes.resolver import MeshRecord, MeshResolver, SIZE, UNUSABLE
from robot_description.robot import Robot
from robot_description.urdf import parse_urdf
from robot_description.xacro.session import XacroSession
from robot_description.xacro.source import unprefixed_calls, XACRO_TAGS

CHECKS: tuple[Callable[[Model], Iterator[Finding]], ...] = (
    structure.check_names,
    structure.check_links_exist,
    structure.check_one_tree,
    structure.check_joints,
    structure.check_mimics,
    structure.check_joint_references,
    structure.check_arbotix_names,
    structure.check_gazebo_references,
    structure.check_materials,
    structure.check_robot_name,
    structure.check_tags,
    structure.check_attributes,
    structure.check_numbers,
    geometry.check_inertials,
    geometry.check_masses,
    geometry.check_inertias,
    geometry.check_sides,
    geometry.check_wheels,
    sensors.check_sensors,
)
# Those that need a robot that can be read.
ROBOT_CHECKS: tuple[Callable[[Model, Robot], Iterator[Finding]], ...] = (
    geometry.check_massless,
    geometry.check_floating,
    geometry.check_size,
    geometry.check_footprint,
)
# The cure where a mesh lies in a package that happens to be installed here.
COPY = "copy the file to where the path says, in the description's own package"
# What is found only because of something else, which is mended first.
FOLLOWS = {
    'unprefixed-macro': {
        *('no-links', 'unknown-link', 'orphan-link', 'several-roots', 'unknown-joint'),
        *('unknown-reference', 'unknown-material', 'unknown-tag', 'illegal-child'),
        *('no-inertials', 'no-mass', 'no-inertial', 'missing-footprint'),
    },
    'no-links': {'unknown-reference', 'unknown-joint', 'unknown-material'},
}
# What a check finds again and again is told so often; the file has other problems then.
MOST_FINDINGS = 200


def lint(session: XacroSession, expected_joints: Sequence[str] = ()) -> list[Finding]:
    """
    Run a session; return the faults of its files and of its result, by files and lines.

    `expected_joints` are names that a controller will look for.

    Raises:
        DescriptionError: the file itself cannot be opened.
    """
    found = []
    try:
        expansion = session.expand()
    except LocatedError as error:
        reason, _, cure = error.reason.partition('; ')
        found.append(finding('not-readable', error.place, reason, cure or None))
    else:
        start = Place(session.path, 1)
        found += [finding('xacro-warning', p or start, text) for p, text in expansion.warnings]
        model = Model(to_element(expansion), session.path, session.search, expected_joints)
        for check in CHECKS:
            found += islice(check(model), MOST_FINDINGS)
        try:
            robot = parse_urdf(expansion.urdf)
        except DescriptionError as error:
            if not any(one.is_error for one in found):  # which tell the same, with lines
                found.append(finding('not-readable', model.robot.place, str(error)))
        else:
            for check_robot in ROBOT_CHECKS:
                found += islice(check_robot(model, robot), MOST_FINDINGS)
            found += _check_meshes(model, robot, session.sources)
    return _in_order(_causes([*found, *_check_macro_calls(session.sources)]))


def _causes(found: list[Finding]) -> list[Finding]:
    """Leave out what follows from other findings; what is no number makes no mass or inertia."""
    codes = {one.rule.code for one in found}
    follow = {code for cause in codes & FOLLOWS.keys() for code in FOLLOWS[cause]}
    no_numbers = {one.place for one in found if one.rule.code == 'bad-number'}
    return [
        one
        for one in found
        if one.rule.code == 'bad-number'
        or not (one.rule.code in follow or one.place in no_numbers)
    ]


def _in_order(found: list[Finding]) -> list[Finding]:
    """Sort by file and line; say what a macro repeats at the same line and words once."""
    unique = {(one.rule.code, one.place, one.message): one for one in found}
    return sorted(unique.values(), key=lambda one: (one.place, one.rule.code))


def _check_meshes(model: Model, robot: Robot, sources: Mapping[Path, bytes]) -> Iterator[Finding]:
    """Every mesh is where its path says, on other machines, too, and can be used; wheels roll."""
    try:
        report = open_meshes(robot, MeshResolver(robot, model.path, model.search).report())
    except DescriptionError as error:
        yield finding('not-readable', model.robot.place, str(error))
        return
    for record in report.repairs:
        place = _place(model, record)
        kinds = record.kind.split('+')
        if SIZE in kinds:
            text = f'{record.use} mesh {record.url!r} of link {record.link!r}: {record.note}'
            yield finding('mesh-size', place, text)
        if record.file is None:
            code = 'unusable-mesh' if UNUSABLE in kinds else 'missing-mesh'
            yield finding(code, place, record.line())
        elif 'foreign-package' in kinds:
            yield finding('foreign-mesh', place, f'{record.url!r} is the mesh of another robot')
        elif kinds != [SIZE]:
            cure = f'write {record.better}' if record.better else COPY
            yield finding('wrong-mesh-path', place, record.line(), cure)
    for record in report.records:
        # $(find) makes absolute paths, too, and is good anywhere.
        is_written = any(record.url.encode() in data for data in sources.values())
        if record.is_exact and record.better is not None and is_written:
            text = f'mesh {record.url!r} is an absolute path: other machines do not have it'
            yield finding('wrong-mesh-path', _place(model, record), text, f'write {record.better}')
    robot = replace(robot, mesh_files=report.files)
    for check in (geometry.check_balance, geometry.check_wheel_room):
        yield from islice(check(model, robot), MOST_FINDINGS)


def _place(model: Model, record: MeshRecord) -> Place:
    """Return where a link names the mesh; other links may name it, too."""
    link = model.links.get(record.link, model.robot)
    for tag in (*link.walk(), *model.robot.walk()):
        if tag.tag == 'mesh' and tag.attributes.get('filename') == record.url:
            return tag.place
    return link.place


def _check_macro_calls(sources: Mapping[Path, bytes]) -> Iterator[Finding]:
    """Macros are called with their prefix, also from within macros and in included files."""
    for path, tag in unprefixed_calls(sources):
        what = 'lacks its prefix' if tag.name in XACRO_TAGS else 'calls a macro without xacro:'
        text = f'<{tag.name}> {what}, so it does nothing'
        cure = f'write <xacro:{tag.name}>; describe fix does it'
        yield finding('unprefixed-macro', Place(path, tag.line, tag.column), text, cure)
