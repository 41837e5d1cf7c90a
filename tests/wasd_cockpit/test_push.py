# SPDX-License-Identifier: Apache-2.0
"""A pointer that is held down in the scene pulls what it took hold of, and nothing else."""

from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
from wasd_cockpit.scene import Scene


class Hand:
    """A pointer on a scene of which a pixel is as long as the page says, and its camera's."""

    def __init__(self, imgui):
        self.scene, self._imgui = Scene(), imgui
        self.scene.hand = 'push'
        camera = SimpleNamespace(azimuth=0.0, elevation=0.0, distance=2.0)
        model = SimpleNamespace(vis=SimpleNamespace(global_=SimpleNamespace(fovy=45.0)))
        viewer = SimpleNamespace(camera=camera, model=model)
        self._page = MagicMock(viewer=viewer, is_live=True)
        imgui.GetIO.return_value.DisplaySize.y = 720.0

    def see(self, grip, x=0.0, mouse=0.0, is_down=True):
        """Return how the page pushes the robot that is in turn, which is at x [m]."""
        self._imgui.IsItemActive.return_value = is_down
        self._imgui.GetMousePos.return_value = SimpleNamespace(x=mouse, y=0.0)
        marks = SimpleNamespace(place=np.array((x, 0.0, 0.3)), size=0.4)
        self.scene._hold(self._page, SimpleNamespace(marks=marks, mass=10.0, grip=grip))
        return self._page.push


@pytest.fixture
def hand(monkeypatch):
    imgui = MagicMock()
    monkeypatch.setattr('wasd_cockpit.scene.imgui', imgui)
    return Hand(imgui)


def test_it_pulls_to_where_it_is_dragged_by_a_force_that_the_robot_follows(hand):
    begun = hand.see((0, 0))
    assert begun == ((0.0, 0.0, 0.0), (0, 0))
    dragged = hand.see((0, 0), mouse=40.0)
    assert dragged.force[1] < 0.0  # the camera looks along x
    assert hand.see((0, 0), is_down=False) is None
    assert hand.see((0, 0), mouse=40.0) == begun


@pytest.mark.parametrize('other', [(1, 0), (0, 1)], ids=['another robot', 'a reset'])
def test_it_pulls_another_robot_and_one_that_was_reset_only_after_its_release(hand, other):
    hand.see((0, 0), x=1.0)
    for grip in (other, (0, 0), other):
        assert hand.see(grip, mouse=40.0) is None
        assert hand.scene.force == 0.0
    hand.see(other, is_down=False)
    assert hand.see(other) == ((0.0, 0.0, 0.0), other)
