# SPDX-License-Identifier: Apache-2.0
"""Where `describe fix` writes, and where it refuses to."""

from pathlib import Path
import shutil

import pytest
from robot_description.describe_command import main
from robot_description.lint.session import lint
from robot_description.xacro.session import XacroSession

FIXTURES = Path(__file__).parent / 'fixtures'


@pytest.fixture
def courses_mbot(tmp_path):
    """Return a copy of the courses' mbot."""
    shutil.copytree(FIXTURES / 'mbot_description', tmp_path / 'mbot_description')
    return tmp_path / 'mbot_description/urdf/mbot.xacro'


def test_a_file_gets_the_mended_text(tmp_path):
    path = FIXTURES / 'lint/repeated-material.urdf'
    assert main(['fix', str(path), '--output', str(tmp_path / 'mended.urdf')]) == 0
    assert lint(XacroSession(tmp_path / 'mended.urdf'))[0].rule.code == 'robot-name'
    assert len(lint(XacroSession(tmp_path / 'mended.urdf'))) == 1


@pytest.mark.slow
def test_a_file_that_misses_others_where_it_is_written_is_told(tmp_path, capsys):
    (tmp_path / 'parts.xacro').write_text('<robot><link name="base"/></robot>')
    text = (FIXTURES / 'lint/repeated-material.urdf').read_text()
    include = '<xacro:include filename="parts.xacro" xmlns:xacro="http://ros.org/wiki/xacro"/>'
    text = text.replace('</robot>', include + '</robot>').replace('"base"', '"body"')
    (path := tmp_path / 'robot.xacro').write_text(text)
    (elsewhere := tmp_path / 'elsewhere').mkdir()
    beside, away = tmp_path / 'mended.xacro', elsewhere / 'mended.xacro'
    main(['fix', str(path), '--output', str(beside)])
    assert 'is missing there' not in capsys.readouterr().err
    assert main(['fix', str(path), '--output', str(away)]) == 1
    said = capsys.readouterr().err
    assert f'left: what lies beside {path} is missing there: write to a file beside it' in said
    assert said.count('no such file') == 1


@pytest.mark.slow
@pytest.mark.parametrize('spelling', ['{0}/mbot.xacro', '{0}/../urdf/mbot.xacro', 'link'])
def test_a_source_is_not_written_over(courses_mbot, tmp_path, capsys, spelling):
    before = courses_mbot.read_bytes()
    (tmp_path / 'link').symlink_to(courses_mbot)
    output = str(tmp_path / spelling.format(courses_mbot.parent))
    assert main(['fix', str(courses_mbot), '--output', output]) == 2
    assert 'is a source' in capsys.readouterr().err
    assert courses_mbot.read_bytes() == before


@pytest.mark.slow
def test_an_included_file_is_not_written_over(courses_mbot, capsys):
    base = courses_mbot.with_name('mbot_base.xacro')
    assert main(['fix', str(courses_mbot), '--output', str(base)]) == 2
    assert 'is a source' in capsys.readouterr().err


@pytest.mark.slow
def test_several_files_need_a_folder(courses_mbot, tmp_path, capsys):
    output = tmp_path / 'mended.xacro'
    assert main(['fix', str(courses_mbot), '--output', str(output)]) == 2
    assert 'mbot_base.xacro changes, too: name a folder' in capsys.readouterr().err
    assert not output.exists()


@pytest.mark.slow
def test_a_folder_that_holds_the_package_already_is_refused(courses_mbot, tmp_path, capsys):
    assert main(['fix', str(courses_mbot), '--output', str(tmp_path)]) == 2
    assert 'is there already' in capsys.readouterr().err


@pytest.mark.slow
def test_a_folder_within_the_package_is_refused(courses_mbot, capsys):
    inside = courses_mbot.parent
    assert main(['fix', str(courses_mbot), '--output', str(inside)]) == 2
    assert 'lies within the package' in capsys.readouterr().err


def test_a_folder_that_cannot_be_written_says_so(courses_mbot, capsys):
    assert main(['fix', 'mbot', '--output', '/no/such/folder/x']) == 2
    assert (
        '--output /no/such/folder/x: wanted a file in a folder that exists'
        in capsys.readouterr().err
    )
