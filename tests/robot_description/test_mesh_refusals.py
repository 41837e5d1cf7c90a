# SPDX-License-Identifier: Apache-2.0
"""A mesh that is nowhere, or out of bounds, is said; a folder is never written to."""

import json
import os

import pytest
from robot_description.description import load_robot
from robot_description.meshes.resolver import MeshRecord, MeshReport, MeshResolver
from robot_description.urdf import parse_urdf
from wasd_core.errors import DescriptionError


def first(report):
    """Return the kind and file of a report's first record."""
    return report.records[0].kind, report.records[0].file


NOWHERE = [
    'package://dog/m/no.stl',
    'package://no/m/no.stl',
    '',
    '.',
    '%',
    '//',
    'a' * 5000,
    'a/' * 3000,
]


@pytest.mark.parametrize('url', NOWHERE)
def test_a_missing_mesh_is_left_out_whatever_it_is_for(resolve, url):
    for use in ('visual', 'collision'):
        report = resolve(url, use=use)
        assert first(report) == ('missing', None)
        assert 'left out' in report.repairs[0].line()


@pytest.mark.parametrize('url', ['http://host/a.stl', 'https://host/m/a.stl'])
def test_nothing_is_fetched(resolve, package, url, put):
    put(package / 'm/a.stl')
    assert first(resolve(url))[0] == 'missing'


def test_strict_refuses_the_first_repair_and_counts_the_rest(package, put):
    put(package / 'm/a.stl', package / 'm/b.stl', package / 'm/c.stl')
    urls = 'package://dog/m/A.stl', 'package://dog/m/b.dae', 'package://dog/m/c.stl'
    meshes = ''.join(
        f'<visual><geometry><mesh filename="{url}"/></geometry></visual>' for url in urls
    )
    path = package / 'urdf/dog.urdf'
    path.write_text(f'<robot name="r"><link name="a">{meshes}</link></robot>')
    assert len(load_robot(str(path)).repairs) == 2
    with pytest.raises(DescriptionError, match=r'--strict: .*A.stl.*: case: .*\(and 1 more\)$'):
        load_robot(str(path), strict=True)


@pytest.mark.parametrize(
    'url',
    [
        '../../secret/a.stl',
        'package://dog/../../../secret/a.stl',
        'package://dog/%2e%2e/secret/a.stl',
        '$(find dog)/../secret/a.stl',
        'file://{}/a.stl',
        '{}/a.stl',
    ],
)
def test_a_url_that_leads_out_is_refused_with_a_cure(resolve, package, url, put):
    secret = package.parent / 'secret'
    put(secret / 'a.stl')
    if '../../../' in url:
        put(package.parents[1] / 'secret/a.stl')
    with pytest.raises(DescriptionError, match=r'leads out of .* --package-path DIR') as caught:
        resolve(url.format(secret))
    assert '\n' not in str(caught.value)


def test_a_folder_that_the_user_gave_may_be_used(resolve, package, put):
    secret = package.parent / 'secret'
    put(secret / 'a.stl')
    assert first(resolve(f'file://{secret}/a.stl', search=[secret])) == ('exact', secret / 'a.stl')


def test_a_neighbour_package_may_be_named_by_its_path(resolve, package, make_package):
    make_package(package.parent / 'cat', 'm/a.stl')
    assert first(resolve('../../cat/m/a.stl'))[1] == package.parent / 'cat/m/a.stl'


def test_a_link_that_leads_out_is_refused_and_one_within_is_not(resolve, package, put):
    put(package.parent / 'secret/a.stl', package / 'm/b.stl')
    os.symlink(package.parent / 'secret/a.stl', package / 'm/a.stl')
    with pytest.raises(DescriptionError, match=r"'package://dog/m/a.stl' leads out of"):
        resolve('package://dog/m/a.stl')
    os.symlink(package / 'm/b.stl', package / 'm/c.stl')
    assert first(resolve('package://dog/m/c.stl')) == ('exact', package / 'm/c.stl')


def test_a_package_that_is_installed_by_links_is_read(
    resolve, package, put, make_package, monkeypatch
):
    # As `colcon build --symlink-install` does it.
    prefix = package.parents[2] / 'install/cat'
    source = make_package(package.parents[2] / 'elsewhere/cat', 'm/a.stl')
    put(prefix / 'share/ament_index/resource_index/packages/cat')
    (prefix / 'share/cat/m').mkdir(parents=True)
    for name in ('package.xml', 'm/a.stl'):
        os.symlink(source / name, prefix / 'share/cat' / name)
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(prefix))
    found = prefix / 'share/cat/m/a.stl'
    assert first(resolve('package://cat/m/a.stl')) == ('foreign-package', found)


def test_links_in_a_circle_end(resolve, package, put):
    os.symlink(package, package / 'again')
    os.symlink(package / 'loop.stl', package / 'loop.stl')
    put(package / 'x/a.stl')
    assert first(resolve('package://dog/m/a.stl')) == ('moved', package / 'x/a.stl')
    assert first(resolve('package://dog/loop.stl'))[1] is None


def test_without_a_package_the_folder_and_its_neighbours_are_used(tmp_path, put):
    put(tmp_path / 'bare/urdf/r.urdf', tmp_path / 'bare/meshes/a.stl')
    visual = '<visual><geometry><mesh filename="{}"/></geometry></visual>'
    text = f'<robot name="r"><link name="a">{visual}</link></robot>'
    for url in ('../meshes/a.stl', 'package://bare/meshes/a.stl'):
        report = MeshResolver(parse_urdf(text.format(url)), tmp_path / 'bare/urdf/r.urdf').report()
        assert first(report) == ('exact', tmp_path / 'bare/meshes/a.stl')


def test_the_report_is_json(resolve, package, put):
    put(package / 'm/base.stl')
    (record,) = resolve('package://dog/m/trunk.stl').repairs
    assert json.loads(json.dumps(record.record())) == {
        'url': 'package://dog/m/trunk.stl',
        'link': 'link_0',
        'use': 'visual',
        'kind': 'near-name',
        'file': str(package / 'm/base.stl'),
        'candidates': [],
        'note': '',
    }


def test_the_source_is_left_as_it_was(resolve, package, put):
    put(package / 'm/base.dae')
    before = sorted(path for path in package.parents[1].rglob('*'))
    resolve('package://dog/m/trunk.dae', 'package://dog/M/BASE.dae')
    assert sorted(path for path in package.parents[1].rglob('*')) == before


def test_a_url_used_twice_is_said_once():
    twice = [MeshRecord('a', link, 'visual', 'missing') for link in ('one', 'two')]
    assert MeshReport(tuple(twice)).repairs == (twice[0],)
