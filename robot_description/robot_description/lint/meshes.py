# SPDX-License-Identifier: Apache-2.0
"""Checks of mesh files: there, where the path says, and of this robot."""

from collections.abc import Iterator
from pathlib import Path

from wasd_core.errors import DescriptionError
from wasd_core.safe_files import Place

from robot_description.lint.finding import Finding
from robot_description.lint.finding import finding
from robot_description.lint.model import Model
from robot_description.mesh_report import MeshRecord
from robot_description.mesh_resolver import resolve_meshes
from robot_description.package_tree import manifest_name
from robot_description.package_tree import own_package
from robot_description.urdf import Robot


def check_meshes(model: Model, robot: Robot) -> Iterator[Finding]:
    """Every mesh is where its path says."""
    try:
        report = resolve_meshes(robot, model.path, model.search)
    except DescriptionError as error:
        yield finding('not-readable', model.robot.place, str(error))
        return
    for record in report.repairs:
        place = _place(model, record)
        if record.file is None:
            yield finding('missing-mesh', place, record.line())
        elif 'foreign-package' in record.kind.split('+'):
            yield finding('foreign-mesh', place, f'{record.url!r} is the mesh of another robot')
        else:
            cure = f'write {better_url(record.file)}'
            yield finding('wrong-mesh-path', place, record.line(), cure)


def _place(model: Model, record: MeshRecord) -> Place:
    """Return where a link names the mesh; other links may name it, too."""
    link = model.links.get(record.link, model.robot)
    for tag in (*link.walk(), *model.robot.walk()):
        if tag.tag == 'mesh' and tag.attributes.get('filename') == record.url:
            return tag.place
    return link.place


def better_url(file: Path) -> str:
    """Return how a file is named in a description: by its package, if it has one."""
    package = own_package(file)
    name = manifest_name(package) if package else None
    return f'package://{name}/{file.relative_to(package)}' if package and name else str(file)
