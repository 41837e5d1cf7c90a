# SPDX-License-Identifier: Apache-2.0
"""How often a page is worked on: never more than somebody looks, less for a hurried simulation."""

import threading
import time

from mujoco_sim.viewer.clicks import Mouse
from mujoco_sim.viewer.drawing import Pace, PacedUi, UNSEEN_PERIOD
from mujoco_sim.viewer.input import PageInput
import pytest

NONE: frozenset[int] = frozenset()
LONG = 60.0  # [s]; no test waits so long


class Ui:
    """A user interface that counts the frames that are begun."""

    frames = 0
    buttons = 0  # that a frame sees down

    def new_frame(self) -> bool:
        """Begin one."""
        self.frames += 1
        return True

    def end_frame(self) -> None:
        """End it."""


def draw(ui: PacedUi, frames: int = 1) -> None:
    """Draw so many frames."""
    for _ in range(frames):
        ui.new_frame()
        ui.end_frame()


@pytest.fixture
def page() -> PageInput:
    """Return the input of a page that nobody has opened."""
    return PageInput()


def test_a_page_that_nobody_sees_is_hardly_worked_on(page):
    pace = Pace(page)
    assert pace.scene == UNSEEN_PERIOD
    page.watch('spectator')
    seen = pace.scene
    assert seen <= 1.0 / 60.0
    page.lose('spectator')
    assert pace.scene == UNSEEN_PERIOD
    page.hear('driver', NONE)
    assert pace.scene == seen
    page.lose('driver')
    assert pace.scene == UNSEEN_PERIOD


def test_a_hurried_simulation_draws_a_third_of_the_page(page):
    pace = Pace(page)
    page.hear('driver', NONE)
    scene, panels = pace.scene, pace.panels
    pace.is_hurried = True
    assert pace.scene >= 3.0 * scene
    assert pace.panels >= 3.0 * panels
    # Still ten times a second, whatever the simulation does.
    assert pace.scene < pace.panels <= 0.1


def test_the_scene_of_a_lone_page_waits_for_its_picture(page, monkeypatch):
    monkeypatch.setattr('mujoco_sim.viewer.drawing.LONE_PICTURE_TIMEOUT', LONG)
    ui = PacedUi(Ui(), page, Pace(page), lambda: 0, lambda: False)
    page.watch('driver')
    page.hear('driver', NONE)
    draw(ui)
    frame = threading.Thread(target=ui.new_frame)
    frame.start()
    frame.join(0.2)
    assert frame.is_alive()
    page.hear('driver', NONE)
    frame.join(0.5 * LONG)
    assert not frame.is_alive()


def test_a_scene_waits_for_no_picture_where_others_look_or_a_click_or_panels_wait(
    page, monkeypatch
):
    monkeypatch.setattr('mujoco_sim.viewer.drawing.LONE_PICTURE_TIMEOUT', LONG)
    ui = PacedUi(Ui(), page, Pace(page), lambda: 0, lambda: False)

    def see_it_draw_two() -> None:
        """Draw one for what was heard, and one for nothing."""
        frames = threading.Thread(target=draw, args=(ui, 2))
        frames.start()
        frames.join(0.5 * LONG)
        assert not frames.is_alive()

    see_it_draw_two()  # nobody is there
    page.watch('driver')
    page.watch('spectator')
    page.hear('driver', NONE)
    see_it_draw_two()
    page.lose('spectator')
    monkeypatch.setattr('mujoco_sim.viewer.drawing.PANEL_PERIOD', LONG)
    page.hear('driver', NONE)
    draw(ui)
    page.hear('driver', NONE)
    see_it_draw_two()  # panels are not due
    monkeypatch.undo()
    monkeypatch.setattr('mujoco_sim.viewer.drawing.LONE_PICTURE_TIMEOUT', LONG)
    page.hear('driver', NONE, Mouse(1))
    see_it_draw_two()  # no frame has seen the click
    page.lose('driver')
    see_it_draw_two()


def test_a_hurried_page_has_a_frame_of_panels_for_a_click_at_once(page, monkeypatch):
    monkeypatch.setattr('mujoco_sim.viewer.drawing.HURRIED_SCENE_PERIOD', LONG)
    monkeypatch.setattr('mujoco_sim.viewer.drawing.HURRIED_PANEL_PERIOD', LONG)
    pace, inner = Pace(page), Ui()
    ui = PacedUi(inner, page, pace, lambda: inner.buttons, lambda: False)
    pace.is_hurried = True
    page.hear('driver', NONE)
    assert ui.new_frame()
    ui.end_frame()
    frame = threading.Thread(target=ui.new_frame)
    frame.start()
    page.hear('driver', NONE)
    frame.join(0.2)
    assert frame.is_alive()
    assert inner.frames == 1
    page.hear('driver', NONE, Mouse(1))
    frame.join(LONG)
    assert inner.frames == 2


def test_what_a_click_does_is_shown_without_waiting_for_a_hurried_page(page, monkeypatch):
    """Panels may see a press or its end only in the frame after the one that is begun for it."""
    monkeypatch.setattr('mujoco_sim.viewer.drawing.HURRIED_PANEL_PERIOD', LONG)
    pace, inner = Pace(page), Ui()
    ui = PacedUi(inner, page, pace, lambda: inner.buttons, lambda: False)
    pace.is_hurried = True
    begun = []
    for buttons in (0, 1, 1, 1):
        page.hear('driver', NONE, Mouse(buttons))
        inner.buttons = buttons
        ui.new_frame()
        ui.end_frame()
        begun.append(inner.frames)
    assert begun == [1, 2, 3, 3]


def test_a_click_that_a_frame_did_not_see_yet_gets_another_without_a_picture(page, monkeypatch):
    """The page draws none for it: its later packets are held back until then."""
    monkeypatch.setattr('mujoco_sim.viewer.drawing.PANEL_PERIOD', 0.0)
    inner = Ui()
    ui = PacedUi(inner, page, Pace(page), lambda: inner.buttons, lambda: False)
    page.hear('driver', NONE, Mouse(1))
    for frames, seen in ((1, 0), (2, 1), (2, 1)):
        inner.buttons = seen
        ui.new_frame()
        ui.end_frame()
        assert inner.frames == frames


def test_a_rest_ends_by_itself(page):
    began = time.monotonic()
    page.rest(0.02)
    page.rest(-1.0)
    assert time.monotonic() - began >= 0.02
