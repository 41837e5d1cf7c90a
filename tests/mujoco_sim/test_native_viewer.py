# SPDX-License-Identifier: Apache-2.0
import pytest
from wasd_core.errors import SimulationError


def test_a_window_without_a_display_is_one_line(world, monkeypatch):
    from mujoco_sim.viewer.camera import CameraView
    from mujoco_sim.viewer.views import NativeView

    monkeypatch.delenv('DISPLAY', raising=False)
    monkeypatch.delenv('WAYLAND_DISPLAY', raising=False)
    with pytest.raises(SimulationError, match='no display here'):
        NativeView(world, CameraView(1.0, 0.0, 0.0))
