# SPDX-License-Identifier: Apache-2.0
from cases import for_all
import pytest
from wasd_core.errors import SimulationError


@for_all('display', ['', ':97531'])
def test_a_window_without_a_display_is_one_line(world, monkeypatch, display):
    from mujoco_sim.viewer.camera import CameraView
    from mujoco_sim.viewer.views import NativeView

    monkeypatch.setenv('DISPLAY', display)
    monkeypatch.delenv('WAYLAND_DISPLAY', raising=False)
    with pytest.raises(SimulationError, match='no display here'):
        NativeView(world, CameraView(1.0, 0.0, 0.0))
