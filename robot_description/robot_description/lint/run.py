# SPDX-License-Identifier: Apache-2.0
"""Runs all checks on a file."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path

from wasd_core.errors import DescriptionError
from wasd_core.safe_files import LocatedError
from wasd_core.safe_files import Place

from robot_description.expand import run_session
from robot_description.lint import bodies
from robot_description.lint import references
from robot_description.lint import sides
from robot_description.lint import structure
from robot_description.lint import vocabulary
from robot_description.lint.finding import Finding
from robot_description.lint.finding import finding
from robot_description.lint.meshes import check_meshes
from robot_description.lint.model import make_model
from robot_description.lint.model import Model
from robot_description.lint.sources import check_macro_calls
from robot_description.reach import Reach
from robot_description.urdf import parse_urdf
from robot_description.xacro_session import XacroSession

CHECKS: tuple[Callable[[Model], Iterator[Finding]], ...] = (
    structure.check_names,
    structure.check_links_exist,
    structure.check_one_tree,
    structure.check_joints,
    references.check_joint_references,
    references.check_arbotix_names,
    references.check_gazebo_references,
    references.check_materials,
    references.check_robot_name,
    vocabulary.check_tags,
    vocabulary.check_attributes,
    vocabulary.check_numbers,
    bodies.check_inertials,
    bodies.check_masses,
    bodies.check_inertias,
    sides.check_sides,
    sides.check_wheels,
    sides.check_footprint,
)


# What a check finds again and again is told so often; the file has other problems then.
MOST_FINDINGS = 200


def lint(
    path: Path,
    arguments: Mapping[str, str] | None = None,
    search: Sequence[Path] = (),
    expected_joints: Sequence[str] = (),
) -> list[Finding]:
    """
    Return what is wrong with a xacro or URDF file, in the order of files and lines.

    `expected_joints` are names that a controller will look for.

    Raises:
        DescriptionError: the file itself cannot be opened.
    """
    session = XacroSession(path, arguments or {}, Reach(path, search))
    return lint_session(session, search, expected_joints)


def lint_session(
    session: XacroSession, search: Sequence[Path] = (), expected_joints: Sequence[str] = ()
) -> list[Finding]:
    """
    Run a session and return what is wrong with what it reads and makes.

    Raises:
        DescriptionError: the file itself cannot be opened.
    """
    found = []
    try:
        expansion = run_session(session)
    except LocatedError as error:
        found.append(finding('not-readable', error.place, error.reason))
    else:
        start = Place(session.path, 1)
        found += [finding('xacro-warning', p or start, text) for p, text in expansion.warnings]
        model = make_model(expansion, session.path, search, expected_joints)
        for check in CHECKS:
            found += islice(check(model), MOST_FINDINGS)
        found += _meshes(model, expansion.urdf)
    calls = list(check_macro_calls(session.sources))
    told = {call.place for call in calls}
    found = [one for one in found if one.rule.code != 'unknown-tag' or one.place not in told]
    return _in_order(found + calls)


def _meshes(model: Model, urdf: str) -> list[Finding]:
    try:
        robot = parse_urdf(urdf)
    except DescriptionError:  # which other checks have told about, with lines
        return []
    return list(check_meshes(model, robot))


def _in_order(found: list[Finding]) -> list[Finding]:
    """Sort by file and line; say what a macro repeats at the same line and words once."""
    unique = {(one.rule.code, one.place, one.message): one for one in found}
    return sorted(unique.values(), key=lambda one: (one.place, one.rule.code))
