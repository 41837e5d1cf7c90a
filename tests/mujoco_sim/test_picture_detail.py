# SPDX-License-Identifier: Apache-2.0
"""Shadows and the like are drawn where they do not make the page slow."""

import mujoco
from mujoco_sim.viewer.drawing import FAST, FAST_FOR, PictureDetail, SLOW, SLOW_FOR
import pytest

ALL = [1] * int(mujoco.mjtRndFlag.mjNRNDFLAG)
SHADOW = int(mujoco.mjtRndFlag.mjRND_SHADOW)
SKY = int(mujoco.mjtRndFlag.mjRND_SKYBOX)


@pytest.fixture
def detail() -> PictureDetail:
    """Return the detail for a browser that has just come."""
    return PictureDetail()


def draw(detail: PictureDetail, rate: int | None, seconds: float) -> bool:
    """Have a browser draw for some seconds; return whether it draws everything then."""
    for _ in range(round(seconds * 10)):
        detail.step(rate, 0.1)
    return detail.is_full


def test_a_browser_that_draws_slowly_is_never_asked_for_shadows(detail):
    assert not draw(detail, None, 10.0)
    assert not draw(detail, FAST - 1, 100.0)
    assert detail.flags(ALL)[SHADOW] == 0
    assert detail.flags(ALL)[SKY] == 1


def test_a_browser_that_draws_fast_is_given_everything(detail):
    assert not draw(detail, 60, FAST_FOR - 0.5)
    assert draw(detail, 60, 1.0)
    assert detail.flags(ALL) == ALL


def test_a_browser_that_shadows_make_slow_does_without_from_then_on(detail):
    assert draw(detail, 60, FAST_FOR + 1.0)
    assert draw(detail, SLOW - 1, SLOW_FOR - 0.5)
    assert not draw(detail, SLOW - 1, 1.0)
    assert not draw(detail, 60, 100.0)


def test_a_moment_in_which_a_browser_is_slow_costs_no_shadows(detail):
    assert draw(detail, 60, FAST_FOR + 1.0)
    for _ in range(5):
        assert draw(detail, SLOW - 1, SLOW_FOR - 0.5)
        assert draw(detail, 60, 0.5)


def test_the_next_browser_is_asked_again(detail):
    draw(detail, 60, FAST_FOR + 1.0)
    draw(detail, SLOW - 1, SLOW_FOR + 1.0)
    detail.reset()
    assert draw(detail, 60, FAST_FOR + 1.0)
