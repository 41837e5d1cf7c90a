# SPDX-License-Identifier: Apache-2.0
"""Caches are the user's alone, and where they cannot be a line says where they are instead."""

import os
from pathlib import Path

import pytest
from wasd_core.cache import cache_folder

from wasd_core import cache


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    """An empty home, an empty folder for temporary files, and nothing said yet."""
    for name in ('home', 'tmp'):
        (tmp_path / name).mkdir(mode=0o700)
    monkeypatch.delenv('XDG_CACHE_HOME', raising=False)
    monkeypatch.setenv('HOME', str(tmp_path / 'home'))
    monkeypatch.setenv('TMPDIR', str(tmp_path / 'tmp'))
    for function in (cache.say_once, cache._folder_in, cache._make):
        function.cache_clear()
    yield tmp_path / 'home'
    for function in (cache.say_once, cache._folder_in, cache._make):
        function.cache_clear()


def test_a_cache_is_in_the_home_and_for_its_user_alone(home, capsys):
    folder = cache_folder('things')
    assert folder == home / '.cache/wasd/things'
    assert {path.stat().st_mode & 0o777 for path in (folder, folder.parent)} == {0o700}
    assert cache_folder('things') == folder
    assert capsys.readouterr().err == ''


def test_a_cache_is_where_xdg_says_unless_that_depends_on_the_current_folder(home, monkeypatch):
    monkeypatch.setenv('XDG_CACHE_HOME', str(home / 'elsewhere'))
    assert cache_folder('things') == home / 'elsewhere/wasd/things'
    monkeypatch.setenv('XDG_CACHE_HOME', 'here')
    assert cache_folder('things') == home / '.cache/wasd/things'
    assert not Path('here').exists()


def test_without_a_home_to_write_to_it_is_among_temporary_files_and_a_line_says_so(home, capsys):
    (home / '.cache').touch()  # no folder can be made there, not even by root
    folder = cache_folder('things')
    assert folder == home.parent / f'tmp/wasd-{os.geteuid()}/things'
    assert folder.parent.stat().st_mode & 0o777 == 0o700
    cache_folder('others')
    assert capsys.readouterr().err == (
        f'wasd: caches are kept in {folder.parent}: cannot make {home}/.cache/wasd: '
        'Not a directory\n'
    )


def test_without_any_place_nothing_is_kept_and_a_line_says_so(home, monkeypatch, capsys):
    (home / '.cache').touch()
    monkeypatch.setenv('TMPDIR', str(home / '.cache'))
    assert cache_folder('things') is None
    said = capsys.readouterr().err
    assert said.count('\n') == 1
    assert said.startswith('wasd: there are no caches, so each start takes longer: ')


def test_a_folder_that_others_can_write_is_not_taken(home, capsys):
    (home / '.cache').mkdir()
    (home / '.cache/wasd').mkdir()
    (home / '.cache/wasd').chmod(0o777)
    folder = cache_folder('things')
    assert folder is not None
    assert home not in folder.parents
    assert 'can be written by any user' in capsys.readouterr().err
