# SPDX-License-Identifier: Apache-2.0
import os
from pathlib import Path
import re
import subprocess
import sys

from cases import for_all
import pytest
from robot_description.packages import description_path, share_directory
from robot_description.xacro import session
from robot_description.xacro.session import expand_document
from wasd_core.errors import DescriptionError, PackageNotFound

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
    """Return the one line that a failing expansion says, without the path it begins with."""
    with pytest.raises(DescriptionError) as caught:
        expand_document(path, **options)
    text = str(caught.value)
    assert '\n' not in text
    assert text.startswith(f'{path}:')
    return text.removeprefix(f'{path}:')


def test_properties_are_evaluated(write):
    path = write('<xacro:property name="a" value="2"/><link name="link_${a*a}"/>')
    assert '<link name="link_4"/>' in expand_document(path).urdf


@pytest.mark.slow
def test_arguments_reach_the_file(write):
    path = write('<xacro:arg name="side" default="left"/><link name="$(arg side)"/>')
    assert 'name="left"' in expand_document(path).urdf
    assert 'name="right"' in expand_document(path, {'side': 'right'}).urdf


@pytest.mark.slow
def test_find_answers_from_the_search_path_first(write, tmp_path):
    write('<link name="theirs"/>', 'robot_description/part.xacro')
    path = write('<xacro:include filename="$(find robot_description)/part.xacro"/>')
    assert 'theirs' in expand_document(path, search=[tmp_path]).urdf
    assert 'theirs' in expand_document(path, search=[tmp_path / 'robot_description']).urdf


def test_find_knows_our_own_packages_without_a_ros(write, monkeypatch):
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    path = write('<link name="$(find robot_description)"/>')
    assert f'name="{share_directory("robot_description")}"' in expand_document(path).urdf


def test_find_takes_our_own_packages_from_the_clone_not_from_the_venvs_copy(
    write, tmp_path, monkeypatch
):
    marker = tmp_path / 'share/ament_index/resource_index/packages/robot_description'
    marker.parent.mkdir(parents=True)
    marker.touch()
    monkeypatch.setattr('sys.prefix', str(tmp_path))
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    path = write('<link name="$(find robot_description)"/>')
    assert f'name="{share_directory("robot_description")}"' in expand_document(path).urdf


def test_find_asks_the_ament_index(write, tmp_path, monkeypatch):
    marker = tmp_path / 'share/ament_index/resource_index/packages/arm'
    marker.parent.mkdir(parents=True)
    marker.touch()
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path}')
    assert share_directory('arm') == tmp_path / 'share/arm'
    assert str(tmp_path / 'share/arm') in expand_document(write('<link name="$(find arm)"/>')).urdf


def test_find_knows_the_package_around_the_file_and_those_beside_it(write, tmp_path):
    (tmp_path / 'robots/dog/xacro').mkdir(parents=True)
    (tmp_path / 'robots/cat').mkdir()
    for name in ('dog', 'cat'):
        manifest = tmp_path / f'robots/{name}/package.xml'
        manifest.write_text(f'<package><name>{name}</name></package>')
    path = write('<link name="$(find dog) $(find cat)"/>', 'robots/dog/xacro/dog.xacro')
    assert f'name="{tmp_path}/robots/dog {tmp_path}/robots/cat"' in expand_document(path).urdf


def test_the_package_around_the_file_comes_before_those_beside_it(write, tmp_path):
    for folder in ('a_copy', 'mine'):
        (tmp_path / folder).mkdir()
        manifest = tmp_path / folder / 'package.xml'
        manifest.write_text('<package><name>dog</name></package>')
    path = write('<link name="$(find dog)"/>', 'mine/dog.xacro')
    assert f'name="{tmp_path}/mine"' in expand_document(path).urdf


def test_packages_in_the_folder_for_temporary_files_are_strangers(write, tmp_path, monkeypatch):
    monkeypatch.setattr('tempfile.gettempdir', lambda: str(tmp_path))
    for name in ('dog', 'cat'):
        (tmp_path / name).mkdir()
        manifest = tmp_path / name / 'package.xml'
        manifest.write_text(f'<package><name>{name}</name></package>')
    path = write('<link name="$(find cat)"/>', 'dog/dog.xacro')
    assert "package 'cat' not found" in error_of(path)


def test_dirname_is_the_folder_of_the_file_it_stands_in(write, tmp_path):
    write('<link name="$(dirname)"/>', 'parts/part.xacro')
    path = write('<xacro:include filename="$(dirname)/parts/part.xacro"/>')
    assert f'name="{tmp_path}/parts"' in expand_document(path).urdf


def test_an_include_may_be_a_pattern(write):
    write('<link name="a"/>', 'parts/a.xacro')
    write('<link name="b"/>', 'parts/b.xacro')
    text = expand_document(write('<xacro:include filename="parts/*.xacro"/>')).urdf
    assert text.index('name="a"') < text.index('name="b"')


def test_an_optional_include_may_be_missing(write):
    path = write('<xacro:include filename="nope.xacro" optional="true"/><link name="a"/>')
    assert '<link name="a"/>' in expand_document(path).urdf


EXPAND_WITHOUT_AMENT = """
import sys, types
class Ament(types.ModuleType):
    def __getattr__(self, name):
        raise AssertionError('asked for ' + name)
for name in ('ament_index_python', 'ament_index_python.packages'):
    sys.modules[name] = Ament(name) if sys.argv[1] == 'with' else None
from robot_description.xacro.session import expand_document
from robot_description.packages import description_path
for name in ('go2', 'mbot'):
    print(expand_document(description_path(name)).urdf)
"""


@pytest.mark.slow
def test_the_expansion_is_the_same_with_and_without_ament():
    texts = [
        subprocess.run(
            [sys.executable, '-c', EXPAND_WITHOUT_AMENT, how],
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        for how in ('with', 'without')
    ]
    assert texts[0] == texts[1]
    assert texts[0].count('<robot ') == 2


def test_find_takes_the_current_folder_as_search_path(write, tmp_path, monkeypatch):
    write('<link name="x"/>', 'arm/part.xacro')
    monkeypatch.chdir(tmp_path / 'arm')
    assert share_directory('arm', [Path('.')]) == tmp_path / 'arm'


def test_a_package_not_found_says_where_was_looked(tmp_path):
    with pytest.raises(PackageNotFound, match=f"package 'arm' not found; looked in {tmp_path}"):
        share_directory('arm', [tmp_path])


def test_a_package_not_found_is_one_line_without_the_machinery(write):
    path = write('<xacro:include filename="$(find nope)/part.xacro"/>')
    assert error_of(path).startswith("1: package 'nope' not found; looked in ")


def test_no_such_file(tmp_path):
    assert error_of(tmp_path / 'robot.xacro') == ' no such file'


def test_a_folder_is_no_file(tmp_path):
    assert error_of(tmp_path) == ' is a folder, wanted a file'


@for_all(
    ('body', 'message'),
    [
        ('<xacro:wheel/>', 'unknown macro name: xacro:wheel'),
        ('<link name="${1/0}"/>', 'division by zero'),
        ('<link name="${nope}"/>', 'nope'),
        (
            '<link name="$(arg nope)"/>',
            "the argument 'nope' has no value; give it: --xacro-arg nope:=",
        ),
        (
            '<xacro:if value="$(arg no)"/>',
            "1: the argument 'no' has no value; give it: --xacro-arg no:=false",
        ),
        (
            '<a b="${xacro.arg(\'nope\')}"/>',
            "'nope' has no value; give it: --xacro-arg nope:=VALUE",
        ),
        ('<xacro:include filename="nope.xacro"/>', 'nope.xacro'),
        ('<link>', '1: not well-formed XML: mismatched tag'),
    ],
)
def test_an_error_in_the_file_is_one_line(write, body, message):
    assert message in error_of(write(body))


@for_all(
    'body',
    [
        '<xacro:wheel/>',
        '<link name="${nope}"/>',
        '<link name="$(arg nope)"/>',
        '<xacro:if value="maybe"/>',
        '<a><b>${nope}</b></a>',
        '<xacro:include filename="nope.xacro"/>',
        '<xacro:property name="1a" value="2"/>',
    ],
)
def test_an_error_has_the_line_of_the_element(write, body):
    assert error_of(write(f'<a/>\n<b/>\n\n{body}\n<c/>')).startswith('4: ')


def test_an_error_in_a_macro_has_the_line_in_the_macro(write):
    macro = '<xacro:macro name="m" params="a">\n<link name="${a/0}"/></xacro:macro>'
    assert error_of(write(f'{macro}\n\n<xacro:m a="1"/>')).startswith('2: division by zero')


def test_a_macro_in_another_file_is_reached_from_this_one(write):
    part = write('<xacro:macro name="m">\n<link name="${nope}"/></xacro:macro>', 'part.xacro')
    path = write('<xacro:include filename="part.xacro"/>\n<xacro:m/>')
    with pytest.raises(DescriptionError) as caught:
        expand_document(path)
    assert str(caught.value).startswith(f"{part}:2: name 'nope' is not defined")
    assert str(caught.value).endswith(f'(reached from {path}:2)')


def test_an_argument_the_file_does_not_have_is_a_warning(write):
    path = write('<xacro:arg name="side" default="left"/>')
    ((_, text),) = expand_document(path, {'sied': 'right'}).warnings
    assert text == "no argument 'sied' here; it has: side"


def test_a_warning_of_xacro_has_its_line(write):
    path = write('\n<xacro:property name="pi" value="3"/>')
    ((place, text),) = expand_document(path).warnings
    assert str(place) == f'{path}:2'
    assert text == 'redefining global symbol: pi'


def test_an_error_in_an_included_file_names_that_file(write, tmp_path):
    part = write('\n\n<link>', 'part.xacro')
    path = write('\n<xacro:include filename="part.xacro"/>')
    with pytest.raises(DescriptionError) as caught:
        expand_document(path)
    assert str(caught.value).startswith(f'{part}:3: not well-formed XML: ')
    assert str(caught.value).endswith(f'(reached from {path}:2)')


def test_a_file_that_is_no_text_is_an_error(tmp_path):
    path = tmp_path / 'robot.xacro'
    path.write_bytes(b'\xff\xfe\x00')
    error_of(path)


@pytest.mark.slow
def test_a_failed_expansion_leaves_the_next_one_alone(write):
    broken = write('<link name="$(find nope)"/>', 'broken.xacro')
    whole = write('<link name="whole"/>', 'whole.xacro')
    before = expand_document(whole).urdf
    error_of(broken)
    assert expand_document(whole).urdf == before


def test_a_robot_is_found_by_name():
    assert description_path('mbot').name == 'mbot.urdf.xacro'


def test_a_robot_is_found_by_path(write):
    path = write('')
    assert description_path(str(path)) == path


def test_an_unknown_robot_lists_the_known_ones():
    with pytest.raises(DescriptionError, match=r'^dog: no such file, .*; robots: g1, go2, mbot'):
        description_path('dog')


@pytest.mark.slow
def test_a_package_that_only_a_plugin_wants_is_a_warning(write):
    find = '$(find nope)/a.yaml'
    path = write(f'<gazebo><plugin name="a"><file>{find}</file></plugin></gazebo>')
    expansion = expand_document(path)
    assert 'package://nope/a.yaml' in expansion.urdf
    assert 'left to the program that reads this' in expansion.warnings[0][1]
    assert "package 'nope' not found" in error_of(write(f'<link name="{find}"/>'))
    include = f'<gazebo><xacro:include filename="{find}"/></gazebo>'
    assert "package 'nope' not found" in error_of(write(include))


def test_a_default_that_comes_later_is_proposed(write):
    path = write('<link name="$(arg side)"/><xacro:arg name="side" default="left"/>')
    assert error_of(path).endswith("'side' has no value; give it: --xacro-arg side:=left")


def test_a_property_without_its_prefix_is_told_where_it_is_missed(write):
    path = write('<property name="a" value="1"/>\n<link name="${a}"/>')
    assert error_of(path) == (
        f"2: name 'a' is not defined when evaluating expression 'a'; <property> at {path}:1 lacks "
        'its prefix: write <xacro:property>'
    )


def test_a_file_of_ours_is_expanded_once_in_a_process_until_a_file_that_it_reads_changes(
    write, tmp_path, monkeypatch
):
    own = '<xacro:arg name="link" default="a"/><link name="$(arg link)"/>'
    path = write(f'{own}<xacro:include filename="part.xacro"/>')
    monkeypatch.setattr(session, 'OUR_FILES', {path})
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))
    part = write('<link name="one"/>', 'part.xacro')
    first = expand_document(path)
    assert expand_document(path) is first
    assert 'name="b"' in expand_document(path, {'link': 'b'}).urdf
    assert 'name="b"' not in expand_document(path).urdf
    write('<link name="two"/>', 'part.xacro')
    assert 'name="two"' in expand_document(path).urdf
    part.unlink()
    with pytest.raises(DescriptionError, match=r'robot\.xacro:.*part\.xacro'):
        expand_document(path)


def test_what_a_file_of_ours_expands_to_is_kept_for_others_while_it_would_be_the_same(
    write, tmp_path, monkeypatch
):
    runs, run = [], session.run_bounded
    monkeypatch.setattr(session, 'run_bounded', lambda *job: runs.append(job) or run(*job))
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))
    path = write('<xacro:include filename="part.xacro"/>')
    monkeypatch.setattr(session, 'OUR_FILES', {path})

    def expand(count, **options):
        monkeypatch.setattr(session, '_known', {})  # as in a new process
        runs.clear()
        expansion = expand_document(path, **options)
        assert len(runs) == count
        return expansion

    write('<link name="one"/>', 'part.xacro')
    first = expand(1)
    assert expand(0) == first
    expand(1, arguments={'a': 'b'})
    write('<link name="two"/>', 'part.xacro')
    second = expand(1)
    assert 'name="two"' in second.urdf
    (kept,) = (tmp_path / 'cache/wasd/expansions').iterdir()
    for spoil in (
        lambda: kept.chmod(0o666),
        lambda: kept.write_text('{'),
        lambda: kept.write_text('[]'),
        lambda: kept.write_text(kept.read_text().replace('"state": "', '"state": "0')),
    ):
        spoil()
        assert expand(1) == second
        kept.chmod(0o600)
        assert expand(0) == second


def test_a_file_of_a_user_is_expanded_each_time_also_by_a_path_through_our_folder(
    write, monkeypatch
):
    path = write('<link name="$(optenv WASD_TEST_LINK a)"/>')
    ours = share_directory('robot_description')
    around = ours / os.path.relpath(path, ours)
    for name in 'ab':
        monkeypatch.setenv('WASD_TEST_LINK', name)
        assert f'name="{name}"' in expand_document(around).urdf


def test_our_files_depend_on_no_environment_and_no_yaml():
    for path in (share_directory('robot_description') / 'urdf').rglob('*.xacro'):
        assert not re.search(r'\$\((opt)?env|load_yaml|<xacro:include [^>]*\*', path.read_text())


MADE = """<?xml version="1.0" ?>
<!-- | This document was autogenerated by xacro from $(find r)/r.xacro | -->
<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="a"/></robot>"""


def test_what_xacro_has_made_is_read_without_a_process(tmp_path, monkeypatch):
    path = tmp_path / 'r.urdf'
    path.write_text(MADE)
    with monkeypatch.context() as patch:
        patch.setattr(session, '_is_xacro', lambda data: True)
        by_xacro = expand_document(path)
    monkeypatch.setattr(session, 'run_bounded', lambda *job: pytest.fail('it was run'))
    read = expand_document(path)
    assert read._replace(urdf='') == by_xacro._replace(urdf='')
    assert 'xmlns' not in read.urdf


@for_all(
    'text',
    [
        '<link name="${1 + 1}"/>',
        '<!-- xacro:eval-comments:on --><!-- ${1 + 1} --><link name="a"/>',
        '<!-- a --><xacro:if value="1"><link name="a"/></xacro:if><!-- b -->',
        '<gazebo><![CDATA[<!--]]></gazebo><link name="${2}"/><!-- b -->',
    ],
)
def test_what_only_looks_made_is_expanded(tmp_path, text):
    path = tmp_path / 'r.urdf'
    path.write_text(MADE.replace('<link name="a"/>', text))
    urdf = expand_document(path).urdf.partition('<robot')[2]
    assert '$' not in urdf
    assert 'xacro:if' not in urdf
