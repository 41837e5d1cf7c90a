# SPDX-License-Identifier: Apache-2.0
import ctypes.util
import os

from mujoco_sim.errors import SimulationError
from mujoco_sim.renderer_choice import choose_renderer
import pytest


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


def test_a_window_without_a_display_is_one_line(world, monkeypatch):
    from mujoco_sim.native_viewer import NativeView
    from mujoco_sim.viewer import CameraView

    monkeypatch.delenv('DISPLAY', raising=False)
    monkeypatch.delenv('WAYLAND_DISPLAY', raising=False)
    with pytest.raises(SimulationError, match='no display here'):
        NativeView(world, CameraView(1.0, 0.0, 0.0))
