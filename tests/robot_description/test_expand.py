# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import pytest
from robot_description.errors import DescriptionError
from robot_description.errors import PackageNotFound
from robot_description.expand import expand
from robot_description.packages import share_directory
from robot_description.robots import description_path

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'


@pytest.fixture
def write(tmp_path):
    """Return a function that writes a xacro file and returns its path."""

    def write(body, name='robot.xacro'):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f'{HEAD}{body}</robot>')
        return path

    return write


def error_of(path, **options):
    """Return the one line that a failing expansion says."""
    with pytest.raises(DescriptionError) as caught:
        expand(path, **options)
    text = str(caught.value)
    assert '\n' not in text
    assert text.startswith(f'{path}: ')
    return text.removeprefix(f'{path}: ')


def test_properties_are_evaluated(write):
    path = write('<xacro:property name="a" value="2"/><link name="link_${a*a}"/>')
    assert '<link name="link_4"/>' in expand(path)


def test_arguments_reach_the_file(write):
    path = write('<xacro:arg name="side" default="left"/><link name="$(arg side)"/>')
    assert 'name="left"' in expand(path)
    assert 'name="right"' in expand(path, {'side': 'right'})


def test_find_answers_from_the_search_path_first(write, tmp_path):
    write('<link name="theirs"/>', 'robot_description/part.xacro')
    path = write('<xacro:include filename="$(find robot_description)/part.xacro"/>')
    assert 'theirs' in expand(path, search=[tmp_path])
    assert 'theirs' in expand(path, search=[tmp_path / 'robot_description'])


def test_find_knows_our_own_packages_without_a_ros(write, monkeypatch):
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    path = write('<link name="$(find robot_description)"/>')
    assert f'name="{share_directory("robot_description")}"' in expand(path)


def test_find_asks_the_ament_index(write, tmp_path, monkeypatch):
    marker = tmp_path / 'share/ament_index/resource_index/packages/arm'
    marker.parent.mkdir(parents=True)
    marker.touch()
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path}')
    assert share_directory('arm') == tmp_path / 'share/arm'
    assert str(tmp_path / 'share/arm') in expand(write('<link name="$(find arm)"/>'))


def test_find_takes_the_current_folder_as_search_path(write, tmp_path, monkeypatch):
    write('<link name="x"/>', 'arm/part.xacro')
    monkeypatch.chdir(tmp_path / 'arm')
    assert share_directory('arm', [Path('.')]) == tmp_path / 'arm'


def test_a_package_not_found_says_where_was_looked(tmp_path):
    with pytest.raises(PackageNotFound, match=f"package 'arm' not found; looked in {tmp_path}"):
        share_directory('arm', [tmp_path])


def test_a_package_not_found_is_one_line_without_the_machinery(write):
    path = write('<xacro:include filename="$(find nope)/part.xacro"/>')
    assert error_of(path).startswith("package 'nope' not found; looked in ")


def test_no_such_file(tmp_path):
    assert error_of(tmp_path / 'robot.xacro') == 'no such file'


def test_a_folder_is_no_such_file(tmp_path):
    assert error_of(tmp_path) == 'no such file'


@pytest.mark.parametrize(
    ('body', 'message'),
    [
        ('<xacro:wheel/>', 'unknown macro name: xacro:wheel'),
        ('<link name="${1/0}"/>', 'division by zero'),
        ('<link name="${nope}"/>', 'nope'),
        ('<link name="$(arg nope)"/>', 'Undefined substitution argument nope'),
        ('<xacro:include filename="nope.xacro"/>', 'nope.xacro'),
        ('<link>', 'not well-formed XML: mismatched tag: line 1'),
    ],
)
def test_an_error_in_the_file_is_one_line(write, body, message):
    assert message in error_of(write(body))


def test_an_error_in_an_included_file_names_that_file(write, tmp_path):
    part = write('<link>', 'part.xacro')
    path = write('<xacro:include filename="part.xacro"/>')
    assert error_of(path).startswith(f'in {part}: not well-formed XML: ')


def test_a_file_that_is_no_text_is_an_error(tmp_path):
    path = tmp_path / 'robot.xacro'
    path.write_bytes(b'\xff\xfe\x00')
    error_of(path)


def test_a_failed_expansion_leaves_the_next_one_alone(write):
    broken = write('<link name="$(find nope)"/>', 'broken.xacro')
    whole = write('<link name="whole"/>', 'whole.xacro')
    before = expand(whole)
    error_of(broken)
    assert expand(whole) == before


def test_a_robot_is_found_by_name():
    assert description_path('mbot').name == 'mbot.urdf.xacro'


def test_a_robot_is_found_by_path(write):
    path = write('')
    assert description_path(str(path)) == path


def test_an_unknown_robot_lists_the_known_ones():
    with pytest.raises(DescriptionError, match=r'^dog: no such file, .*; robots: go2, mbot'):
        description_path('dog')
