# SPDX-License-Identifier: Apache-2.0
"""Folders that one may not enter, devices and pipes are a line, or are passed by."""

import os

import pytest
from robot_description.describe_command import main
from robot_description.description import read_description

ROBOT = (
    '<robot name="box"><link name="box"><visual><geometry>{}</geometry></visual></link></robot>'
)


@pytest.fixture
def forbidden(tmp_path, monkeypatch):
    """Return a folder of which the system tells nothing, as to a user who may not enter it."""
    folder = tmp_path / 'forbidden'
    (folder / 'inner').mkdir(parents=True)
    (folder / 'inner/box.urdf').write_text(ROBOT.format('<box size="1 1 1"/>'))

    def guarded(name):
        function = getattr(os, name)

        def call(path, *args, **kwargs):
            within = isinstance(path, str | os.PathLike) and str(path).startswith(f'{folder}/')
            if within or (name in ('open', 'scandir', 'listdir') and str(path) == str(folder)):
                raise PermissionError(13, 'Permission denied', str(path))
            return function(path, *args, **kwargs)

        return call

    for name in ('stat', 'lstat', 'open', 'scandir', 'listdir'):
        monkeypatch.setattr(os, name, guarded(name))
    access = os.access
    monkeypatch.setattr(
        os, 'access', lambda path, mode: str(path) != str(folder) and access(path, mode)
    )
    return folder


def error_of(capsys, *words):
    assert main(words) == 2
    said = capsys.readouterr().err
    assert said.count('\n') == 1
    return said


@pytest.mark.parametrize('command', ['info', 'lint', 'fix', 'expand'])
def test_a_description_that_may_not_be_read_is_a_line(command, forbidden, capsys):
    for path in (forbidden, forbidden / 'inner/box.urdf'):
        assert 'Permission denied' in error_of(capsys, command, str(path))


@pytest.mark.parametrize(('inner', 'reason'), [('', 'may not be read'), ('inner', 'denied')])
def test_a_package_path_that_may_not_be_read_is_a_line(inner, reason, forbidden, capsys):
    (forbidden.parent / 'box.urdf').write_text(ROBOT.format('<box size="1 1 1"/>'))
    words = ['info', str(forbidden.parent / 'box.urdf'), '--package-path', str(forbidden / inner)]
    assert reason in error_of(capsys, *words)


@pytest.mark.parametrize(
    'url', ['file://{}/inner/box.stl', 'forbidden/inner/box.stl', '/dev/zero']
)
def test_a_mesh_that_may_not_be_read_is_missing(url, forbidden):
    path = forbidden.parent / 'box.urdf'
    path.write_text(ROBOT.format(f'<mesh filename="{url.format(forbidden)}"/>'))
    (record,) = read_description(path).meshes.records
    assert record.kind == 'missing'


def test_a_pipe_is_not_waited_for(tmp_path, capsys):
    os.mkfifo(tmp_path / 'robot.urdf')
    said = error_of(capsys, 'info', str(tmp_path / 'robot.urdf'))
    assert 'is a device or pipe' in said
