# SPDX-License-Identifier: Apache-2.0
import ctypes.util
import os

import pytest
from robot_description.mujoco import choose_renderer
from wasd_core.errors import UserError


@pytest.fixture(autouse=True)
def machine(monkeypatch):
    """Return a function that sets which libraries this machine seems to have."""
    monkeypatch.setenv('MUJOCO_GL', 'unset')  # so that it is put back afterwards
    monkeypatch.delenv('MUJOCO_GL')

    def has(*libraries):
        monkeypatch.setattr(
            ctypes.util, 'find_library', lambda name: name if name in libraries else None
        )

    return has


@pytest.mark.parametrize(
    ('libraries', 'chosen'),
    [(('EGL',), 'egl'), (('OSMesa',), 'osmesa'), (('EGL', 'OSMesa'), 'egl'), ((), None)],
)
def test_the_faster_library_that_is_there_is_chosen(machine, libraries, chosen):
    machine(*libraries)
    assert choose_renderer() == (chosen is not None)
    assert os.environ.get('MUJOCO_GL') == chosen


@pytest.mark.parametrize(('wish', 'renders'), [('glfw', True), ('disable', False), ('OFF', False)])
def test_what_the_user_has_set_stays(machine, monkeypatch, wish, renders):
    machine('EGL')
    monkeypatch.setenv('MUJOCO_GL', wish)
    assert choose_renderer() == renders
    assert os.environ['MUJOCO_GL'] == wish


def test_a_word_that_mujoco_does_not_know_is_told_with_those_that_it_does(monkeypatch):
    monkeypatch.setenv('MUJOCO_GL', 'foo')
    with pytest.raises(UserError, match=r"MUJOCO_GL: got 'foo', wanted egl, osmesa, glfw or off"):
        choose_renderer()
