# SPDX-License-Identifier: Apache-2.0
"""What is published on robot_description: meshes under URLs that RViz can open."""

from pathlib import Path
import xml.etree.ElementTree as ElementTree

import pytest
from robot_description.meshes.files import opened_by_rviz, published_urdf

LINK = '<robot><link><geometry><mesh filename={} scale="1 1 1"/></geometry></link></robot>'


def urls(urdf: str) -> list[str]:
    """Return the meshes' URLs as RViz reads them."""
    return [tag.get('filename', '') for tag in ElementTree.fromstring(urdf).iter('mesh')]


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    """A mesh file in a folder whose name is not easy."""
    path = tmp_path / 'a & b' / 'ä.stl'
    path.parent.mkdir()
    path.touch()
    return path


@pytest.mark.parametrize('url', ['package://nobody/a.stl', 'm/a.stl', "it's.stl", 'a&b.stl'])
def test_a_url_that_means_nothing_to_rviz_becomes_that_of_the_file(url, mesh):
    attribute = '"' + url.replace('&', '&amp;') + '"'
    (published,) = urls(published_urdf(LINK.format(attribute), {url: mesh}))
    assert published.startswith('file:///')
    assert published.isascii()
    assert ' ' not in published
    assert opened_by_rviz(published) == mesh


def test_a_package_of_the_ament_index_stays(mesh, tmp_path, monkeypatch):
    index = tmp_path / 'share/ament_index/resource_index/packages'
    index.mkdir(parents=True)
    (index / 'dog').touch()
    (tmp_path / 'share/dog').mkdir()
    (tmp_path / 'share/dog/a.stl').touch()
    url = 'package://dog/a.stl'
    urdf = LINK.format(f'"{url}"')
    assert urls(published_urdf(urdf, {url: mesh})) == [mesh.as_uri()]
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path}')
    assert published_urdf(urdf, {url: mesh}) == urdf
    assert opened_by_rviz(url) == tmp_path / 'share/dog/a.stl'
    mesh.write_text('of the own package, which comes first')
    assert urls(published_urdf(urdf, {url: mesh})) == [mesh.as_uri()]
    # Of another case, say: found by us, but not by RViz.
    assert urls(published_urdf(urdf.replace('a.stl', 'A.stl'), {'package://dog/A.stl': mesh})) == [
        mesh.as_uri()
    ]


def test_what_was_not_found_and_what_is_no_mesh_stays_byte_for_byte(mesh):
    urdf = (
        "<robot>\n<!-- <mesh filename='a.stl'/> --><link name='a.stl'>"
        "<mesh\n filename = 'http://example.org/a.stl'/></link><mesh_of filename='a.stl'/></robot>"
    )
    assert published_urdf(urdf, {'a.stl': mesh}) == urdf
    assert opened_by_rviz('http://example.org/a.stl') is None
