# SPDX-License-Identifier: Apache-2.0
"""Folders with packages and meshes."""

from collections.abc import Callable
from pathlib import Path
from xml.sax.saxutils import quoteattr

import pytest
from robot_description.meshes.resolver import MeshReport, MeshResolver
from robot_description.urdf import parse_urdf

STL = """solid {}
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
endsolid
"""


def _put(*paths: Path) -> None:
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(STL.format(path) if path.suffix == '.stl' else str(path))


def _make_package(folder: Path, *files: str, name: str = '') -> Path:
    _put(*(folder / file for file in files))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / 'package.xml').write_text(f'<package><name>{name or folder.name}</name></package>')
    return folder


def _urdf(*urls: str, use: str = 'visual') -> str:
    """Return a robot whose first link is the root; the others move."""
    meshes = [f'<geometry><mesh filename={quoteattr(url)}/></geometry>' for url in urls]
    links = [
        f'<link name="link_{i}"><{use}>{mesh}</{use}></link>' for i, mesh in enumerate(meshes)
    ]
    joints = [
        f'<joint name="j{i}" type="continuous"><parent link="link_0"/><child link="link_{i}"/>'
        '</joint>'
        for i in range(1, len(urls))
    ]
    return f'<robot name="r">{"".join(links + joints)}</robot>'


@pytest.fixture
def put() -> Callable[..., None]:
    """Return a function that writes files, each of its own content."""
    return _put


@pytest.fixture
def make_package() -> Callable[..., Path]:
    """Return a function that writes a folder with a package.xml and files."""
    return _make_package


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Return the package `dog`, with a description in urdf/."""
    return _make_package(tmp_path / 'ws/src/dog', 'urdf/dog.urdf')


@pytest.fixture
def resolve(package: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., MeshReport]:
    """Return a function that finds meshes, by URLs, of links that `package` describes."""
    for name in ('AMENT_PREFIX_PATH', 'ROS_PACKAGE_PATH'):
        monkeypatch.delenv(name, raising=False)

    def describe(*urls: str, search=(), use: str = 'visual') -> MeshReport:
        robot = parse_urdf(_urdf(*urls, use=use))
        return MeshResolver(robot, package / 'urdf/dog.urdf', search).report()

    return describe
