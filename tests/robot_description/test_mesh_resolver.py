# SPDX-License-Identifier: Apache-2.0
"""Meshes are found where a description meant them to be; what was done is said."""

import pytest


def first(report):
    """Return the kind and file of a report's first record."""
    return report.records[0].kind, report.records[0].file


def test_a_package_url_is_looked_up_in_the_packages_around_the_description(
    resolve, package, put, make_package
):
    make_package(package.parent / 'folder_of_another_name', 'm/a.stl', name='cat')
    put(package / 'meshes/a.stl')
    (package / 'package.xml').write_text('<package><name>dog</name><depend>cat</depend></package>')
    assert first(resolve('package://dog/meshes/a.stl')) == ('exact', package / 'meshes/a.stl')
    other = package.parent / 'folder_of_another_name/m/a.stl'
    assert first(resolve('package://cat/m/a.stl')) == ('exact', other)


def test_the_users_folder_comes_before_the_own_package_and_that_before_ament(
    resolve, package, tmp_path, monkeypatch, put, make_package
):
    put(package / 'm/a.stl')
    make_package(tmp_path / 'prefix/share/dog', 'm/a.stl')
    put(tmp_path / 'prefix/share/ament_index/resource_index/packages/dog')
    given = make_package(tmp_path / 'given/some/where/dog', 'm/a.stl')
    url = 'package://dog/m/a.stl'
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path / 'prefix'))
    assert resolve(url).files[url] == package / 'm/a.stl'
    assert resolve(url, search=[tmp_path / 'given']).files[url] == given / 'm/a.stl'


def test_ament_comes_before_the_workspace_and_that_before_ros_package_path(
    resolve, package, tmp_path, monkeypatch, put, make_package
):
    url = 'package://cat/m/a.stl'
    old = make_package(tmp_path / 'old/cat', 'm/a.stl')
    monkeypatch.setenv('ROS_PACKAGE_PATH', str(tmp_path / 'old'))
    assert resolve(url).files[url] == old / 'm/a.stl'
    around = make_package(package.parent / 'cat', 'm/a.stl')
    assert resolve(url).files[url] == around / 'm/a.stl'
    installed = make_package(tmp_path / 'prefix/share/cat', 'm/a.stl')
    put(tmp_path / 'prefix/share/ament_index/resource_index/packages/cat')
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path / 'prefix'))
    assert resolve(url).files[url] == installed / 'm/a.stl'


def test_what_an_install_leaves_out_is_found_in_the_source(
    resolve, package, monkeypatch, put, make_package
):
    # Unitree's CMake installs meshes/ but neither dae/ nor xacro/.
    put(package / 'dae/a.dae')
    prefix = package.parents[1] / 'install/dog'
    make_package(prefix / 'share/dog', 'meshes/b.dae')
    put(prefix / 'share/ament_index/resource_index/packages/dog')
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(prefix))
    assert first(resolve('package://dog/dae/a.dae')) == ('exact', package / 'dae/a.dae')


# The cases of a description that is not quite right: a URL, a file that is there, what is said.
REPAIRS = [
    ('package://nobody/m/a.stl', 'm/a.stl', 'own-package'),
    ('file:///home/dev/ws/dog/m/a.stl', 'm/a.stl', 're-rooted'),
    ('/home/dev/ws/dog/m/a.stl', 'm/a.stl', 're-rooted'),
    ('$(find dog)/m/a.stl', 'm/a.stl', 'find-left'),
    ('file://$(find dog)/m/a.stl', 'm/a.stl', 'find-left'),
    ('m/a.stl', 'm/a.stl', 'package-root'),
    ('a.stl', 'meshes/a.stl', 'package-root'),
    ('package://dog/Meshes/A.STL', 'meshes/a.stl', 'case'),
    ('package://dog/m/a.dae', 'm/a.stl', 'extension'),
    ('package://dog/m/a.dae', 'm/A.STL', 'extension'),
    ('package://dog/m/a.stl', 'x/y/a.stl', 'moved'),
    ('package://dog/m/a.stl', 'x/y/A.stl', 'moved+case'),
    ('package://dog/m/a.dae', 'x/y/a.obj', 'moved+extension'),
    ('package://dog/m/a%20b.stl', 'm/a b.stl', 'percent-escape'),
    ('package://dog/m\\a.stl', 'm/a.stl', 'backslash'),
    ('file:///C:\\ws\\dog\\m\\a.stl', 'm/a.stl', 'backslash+re-rooted'),
    ('package://dog/m/trunk.dae', 'm/base.dae', 'near-name'),
    ('package://dog/m/dog_base_link.dae', 'm/dog_trunk.dae', 'near-name'),
    ('package://dog/m/thigh1.dae', 'm/thigh_1.dae', 'near-name'),
]


@pytest.mark.parametrize(('url', 'there', 'kind'), REPAIRS)
def test_a_mesh_that_is_not_quite_there_is_found_and_said(resolve, package, url, there, kind, put):
    put(package / there)
    report = resolve(url)
    assert first(report) == (kind, package / there)
    assert not report.records[0].is_exact
    (line,) = [record.line() for record in report.repairs]
    assert repr(url) in line
    assert str(package / there) in line
    assert '\n' not in line


EXACT = [
    ('package://dog/m/a.stl', 'm/a.stl'),
    ('package:///dog/m/a.stl', 'm/a.stl'),
    ('package://dog//m//a.stl', 'm/a.stl'),
    ('package://dog/m/ä b&c.stl', 'm/ä b&c.stl'),
    ('package://dog/m/50%.stl', 'm/50%.stl'),
    ('model://dog/m/a.stl', 'm/a.stl'),
    ('../m/a.stl', 'm/a.stl'),
    ('a.stl', 'urdf/a.stl'),
    ('file:a.stl', 'urdf/a.stl'),
    ('package://dog/m/a%20b.stl', 'm/a%20b.stl'),
]


@pytest.mark.parametrize(('url', 'there'), EXACT)
def test_a_mesh_that_is_where_it_is_said_to_be_is_not_a_repair(resolve, package, url, there, put):
    put(package / there)
    report = resolve(url)
    assert first(report) == ('exact', package / there)
    assert report.repairs == ()


@pytest.mark.parametrize('scheme', ['file://', 'file:', ''])
def test_an_absolute_path_in_the_package_is_used(scheme, resolve, package, put):
    put(package / 'm/a.stl')
    assert first(resolve(f'{scheme}{package}/m/a.stl')) == ('exact', package / 'm/a.stl')


def test_another_robots_package_is_used_and_named(resolve, package, make_package):
    # b2_description's robot.xacro points into b1_description.
    make_package(package.parent / 'puppy', 'm/a.stl')
    kind, file = first(resolve('package://puppy/m/a.stl'))
    assert (kind, file) == ('foreign-package', package.parent / 'puppy/m/a.stl')


def test_of_several_formats_the_best_is_taken(resolve, package, put):
    put(package / 'm/a.stl', package / 'm/a.obj', package / 'm/a.glb')
    assert first(resolve('package://dog/m/a.dae')) == ('extension', package / 'm/a.obj')


def test_a_moved_folder_that_kept_its_own_name_is_preferred(resolve, package, put):
    put(package / 'm/visual/leg.stl', package / 'm/collision/leg.stl')
    found = first(resolve('package://dog/meshes/visual/leg.stl'))
    assert found == ('moved', package / 'm/visual/leg.stl')


def test_copies_of_one_file_are_one(resolve, package):
    # Unitree's clone has the same meshes in meshes/ and dae/.
    for folder in ('meshes', 'dae'):
        (package / folder).mkdir()
        (package / folder / 'a.dae').write_text('same')
    assert first(resolve('package://dog/visuals/a.dae')) == ('moved', package / 'dae/a.dae')


def test_an_ambiguous_name_is_not_guessed_and_lists_the_candidates(resolve, package, put):
    there = (package / 'high/leg.stl', package / 'low/leg.stl')
    put(*there)
    report = resolve('package://dog/meshes/leg.stl')
    (record,) = report.records
    assert (record.kind, record.file) == ('ambiguous', None)
    assert set(record.candidates) == set(there)
    assert all(str(path) in record.line() for path in there)


def test_unitrees_missing_trunk_is_its_base(resolve, package, put):
    # unitree_ros#136: robot.xacro names trunk.dae, the package has base.dae.
    parts = ('base', 'hip', 'thigh', 'thigh_mirror', 'calf', 'calf_mirror', 'foot')
    put(*(package / f'meshes/{part}.dae' for part in parts))
    used = ('trunk', 'hip', 'thigh', 'thigh_mirror', 'calf')
    report = resolve(*(f'package://dog/meshes/{part}.dae' for part in used))
    assert first(report) == ('near-name', package / 'meshes/base.dae')
    assert [record.kind for record in report.records[1:]] == ['exact'] * 4


@pytest.mark.parametrize(
    ('missing', 'there'),
    [
        ('FR_thigh', 'FL_thigh'),
        ('left_wheel', 'right_wheel'),
        ('FRThigh', 'FLThigh'),
        ('link1', 'link2'),
        ('calf', 'calf_mirror'),
        ('shank', 'thigh'),
    ],
)
def test_another_part_is_not_taken_for_the_missing_one(resolve, package, missing, there, put):
    put(package / f'm/{there}.stl')
    assert first(resolve(f'package://dog/m/{missing}.stl')) == ('missing', None)


def test_a_mesh_that_another_link_uses_is_not_taken(resolve, package, put):
    put(package / 'm/base.stl')
    report = resolve('package://dog/m/trunk.stl', 'package://dog/m/base.stl')
    assert first(report) == ('missing', None)


def test_only_the_link_that_carries_the_others_has_aliases(resolve, package, put):
    put(package / 'm/a.stl', package / 'm/base.stl')
    report = resolve('package://dog/m/a.stl', 'package://dog/m/trunk.stl')
    assert [record.kind for record in report.records] == ['exact', 'missing']


def test_two_near_names_are_not_decided_between(resolve, package, put):
    put(package / 'm/base.stl', package / 'm/body.stl')
    (record,) = resolve('package://dog/m/trunk.stl').records
    assert record.kind == 'ambiguous'
    assert [path.name for path in record.candidates] == ['base.stl', 'body.stl']


@pytest.mark.parametrize('missing', ['body', 'trunk', 'base'])
def test_the_base_of_an_arm_is_no_stand_in_for_the_trunk(resolve, package, missing, put):
    put(package / 'meshes/arm/base.stl')
    (record,) = resolve(f'package://dog/meshes/{missing}.stl').records
    assert (record.kind, record.file) == ('ambiguous', None)
    assert record.candidates == (package / 'meshes/arm/base.stl',)
    put(package / 'meshes/visual/base.stl')
    assert first(resolve(f'package://dog/meshes/{missing}.stl'))[1].parent.name == 'visual'


def test_a_near_name_in_a_folder_of_another_robot_is_not_taken(resolve, package, put):
    put(package / 'z1/link2.stl')
    assert first(resolve('package://dog/m/link_2.stl')) == ('ambiguous', None)


def test_the_same_name_in_two_packages_stays_two_files(resolve, package, put, make_package):
    make_package(package.parent / 'cat', 'm/a.stl')
    put(package / 'm/a.stl')
    files = resolve('package://dog/m/a.stl', 'package://cat/m/a.stl').files
    assert len(set(files.values())) == 2


def test_a_file_in_an_installed_package_is_found_by_the_path_that_was_published(
    resolve, tmp_path, monkeypatch, put, make_package
):
    prefix = tmp_path / 'prefix'
    there = make_package(prefix / 'share/cat', 'm/a.stl') / 'm/a.stl'
    put(prefix / 'share/ament_index/resource_index/packages/cat')
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(prefix))
    assert first(resolve(there.as_uri())) == ('exact', there)
    elsewhere = 'file:///home/dev/.local/cmeel.prefix/share/cat/m/a.stl'
    assert first(resolve(elsewhere)) == ('re-rooted', there)
