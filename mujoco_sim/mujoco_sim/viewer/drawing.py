# SPDX-License-Identifier: Apache-2.0
"""What is drawn for the browser: panels, and as much and as often as it can take."""

from collections.abc import Callable, Sequence
import logging
import time
from typing import Any, Protocol

import mujoco
from mujoco.studio import ux
from mujoco.studio.dear_imgui import dear_imgui as imgui

from mujoco_sim.viewer.clicks import BUTTONS
from mujoco_sim.viewer.input import PageInput

_OVERLAY = (
    imgui.WindowFlags.NoDecoration.value
    | imgui.WindowFlags.AlwaysAutoResize.value
    | imgui.WindowFlags.NoInputs.value
)
_EDGE = 12.0  # [pixels]
_LOG = logging.getLogger(__name__)
SLOW_PAGE = 'page slow: make its window smaller'

# A browser that draws so many plain pictures a second, for so long [s], gets detailed ones.
FAST, FAST_FOR = 20, 3.0
# One that then draws fewer than this a second, for so long [s], gets plain ones again.
SLOW, SLOW_FOR = 10, 3.0

# Not post-processing: without it colours are wrong, and too dark.
_COSTLY = (int(mujoco.mjtRndFlag.mjRND_SHADOW), int(mujoco.mjtRndFlag.mjRND_REFLECTION))

# The scene is sent no more often than so [s], panels are drawn no more often: sixty and thirty
# times a second, a little less than the time of one and of two pictures of most browsers.
SCENE_PERIOD, PANEL_PERIOD = 0.012, 0.025
# ... and a third as often while the simulation wants all the time that there is: Python does one
# thing at a time, each change of threads costs, and a frame of panels as much as several ticks of
# a leg controller.
HURRIED_SCENE_PERIOD, HURRIED_PANEL_PERIOD = 0.045, 0.09
# ... and this often while nobody looks.
UNSEEN_PERIOD = 0.1
# A scene waits no longer than so for a picture of the browser, which may be slow or gone [s] ...
PICTURE_TIMEOUT = 0.005
# ... and so long if it is for that browser alone: the next picture of a slow one shows a state
# that is hardly older, and what is sent in between is shown by none.
LONE_PICTURE_TIMEOUT = 0.05
# How often it is tried to reach a browser that has not been heard yet [s].
CONNECT_PERIOD = 0.2

Draw = Callable[[], None]


class PageContent(Protocol):
    """What is drawn on a page before its scene, in the viewer's thread."""

    @property
    def panels(self) -> dict[str, Draw]:
        """The function of each panel, in the order of drawing."""

    def lines(self) -> Sequence[str]:
        """Return what the panels say in words, from any thread."""

    @property
    def is_typing(self) -> bool:
        """Whether keys are for a field of text."""

    def begin(self, viewer: Any, page_input: PageInput) -> None:
        """Begin a frame of panels."""

    def end(self) -> None:
        """End a frame of panels in which none failed."""


class Panel:
    """Text on the page: `status` is asked for every frame, `help` unfolds on a click."""

    def __init__(self, status: Callable[[], Sequence[str]], help_lines: Sequence[str]) -> None:
        self._status = status
        self._help = help_lines
        self._lines_above = 0
        self._is_slow = False

    @property
    def panels(self) -> dict[str, Draw]:
        """The function of each panel, in the order of drawing."""
        return {'status': self._draw_status, 'keys': self._draw_help}

    def lines(self) -> Sequence[str]:
        """Return what the panels say in words, from any thread."""
        return self._status()

    @property
    def is_typing(self) -> bool:
        """Whether keys are for a field of text."""
        return bool(imgui.GetIO().WantCaptureKeyboard)

    def begin(self, viewer: Any, page_input: PageInput) -> None:
        """Begin a frame of panels."""
        self._is_slow = page_input.is_slow

    def end(self) -> None:
        """End a frame of panels."""

    def _draw_status(self) -> None:
        lines = list(self._status())
        self._lines_above = len(lines) + 1  # with room for what follows
        if self._is_slow:
            lines.append(SLOW_PAGE)
        draw_lines('status', lines)

    def _draw_help(self) -> None:
        """Draw lines that stay folded until the user wants them: the robot is to be seen."""
        below = 30.0 + imgui.GetTextLineHeightWithSpacing() * (self._lines_above + 0.5)
        imgui.SetNextWindowPos(imgui.Vec2(_EDGE, below), imgui.Cond.FirstUseEver)
        imgui.SetNextWindowCollapsed(True, imgui.Cond.FirstUseEver)
        imgui.SetNextWindowBgAlpha(0.8)
        imgui.Begin('keys (double-click)', flags=imgui.WindowFlags.AlwaysAutoResize)
        for line in self._help:
            imgui.Text(line)
        imgui.End()


class Panels:
    """
    Draws the panels of a page in order, each with its function.

    One that raises is logged, once, and says in its place that it failed; the run goes on.
    """

    def __init__(self, content: PageContent) -> None:
        self._content = content
        self._draw = content.panels
        self.failed: set[str] = set()

    def draw(self, viewer: Any, page_input: PageInput) -> None:
        """Draw all of them."""
        self._content.begin(viewer, page_input)
        if self._draw_all():
            self._content.end()
        page_input.set_typing(self._content.is_typing)
        if self.failed:
            draw_lines('failed', [f'panel {name} failed' for name in sorted(self.failed)], 0.4)

    def _draw_all(self) -> bool:
        """Draw until one fails; False when one did, and all that was open is closed."""
        for name, draw in self._draw.items():
            if name in self.failed:
                continue
            try:
                draw()
            except Exception:
                # Whatever it is: a panel is no reason to stop a robot.
                ux.unwind_imgui_frame()
                self.failed.add(name)
                _LOG.exception('panel %s failed', name)
                return False
        return True


def draw_lines(name: str, lines: Sequence[str], height: float = 0.0) -> None:
    """Draw lines at the left edge, at a height of the page from 0 (top) to 1."""
    top = _EDGE + height * imgui.GetIO().DisplaySize.y
    imgui.SetNextWindowPos(imgui.Vec2(_EDGE, top), imgui.Cond.Always)
    imgui.SetNextWindowBgAlpha(0.6)
    imgui.Begin(name, flags=_OVERLAY)
    for line in lines:
        imgui.Text(line)
    imgui.End()


class PictureDetail:
    """
    Decides whether a browser is asked for shadows and reflections.

    It begins without: on a machine without a graphics card they cost seconds a picture. A browser
    that draws fast earns them, once: one that they make slow does without from then on.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin with another browser."""
        self.is_full = False
        self._may_rise = True
        self._since = 0.0

    def step(self, rate: int | None, dt: float) -> None:
        """Let `dt` [s] pass in which so many pictures a second were drawn; None if not known."""
        if rate is None:
            is_wrong = False
        elif self.is_full:
            is_wrong = rate < SLOW
        else:
            is_wrong = self._may_rise and rate >= FAST
        self._since = self._since + dt if is_wrong else 0.0
        if self.is_full and self._since >= SLOW_FOR:
            self.is_full, self._may_rise, self._since = False, False, 0.0
        elif not self.is_full and self._since >= FAST_FOR:
            self.is_full, self._since = True, 0.0

    def flags(self, flags: list[int]) -> list[int]:
        """Return a renderer's flags with the costly ones as decided."""
        return [
            int(self.is_full) if flag in _COSTLY else value for flag, value in enumerate(flags)
        ]


def buttons_down() -> int:
    """Return which of the mouse's buttons the frame that is drawn sees down, a bit for each."""
    return sum(imgui.IsMouseDown(button) << button for button in BUTTONS)


def is_mark_down() -> bool:
    """Return whether the frame that is drawn sees the mark of a stroke."""
    return bool(imgui.IsKeyDown(imgui.Key.F23))


class Pace:
    """
    The periods of work on a page [s], in the viewer's thread and in the simulation's.

    `is_hurried` is set by the simulation: whether it has no time to spare.
    """

    def __init__(self, page_input: PageInput) -> None:
        self._input = page_input
        self.is_hurried = False

    @property
    def scene(self) -> float:
        """The time between two states of the scene."""
        if not self._input.is_watched:
            return UNSEEN_PERIOD
        return HURRIED_SCENE_PERIOD if self.is_hurried else SCENE_PERIOD

    @property
    def panels(self) -> float:
        """The time between two frames of panels."""
        return HURRIED_PANEL_PERIOD if self.is_hurried else PANEL_PERIOD


class PacedUi:
    """
    Studio's headless user interface, which would build a frame whether it can be shown or not.

    A frame of panels is begun only when the browser has drawn since the last one, so what it
    shows is never older than two of its own pictures; with no browser there is none. A fast
    browser gets them as a Pace says, and one for each button that goes down or up.
    """

    def __init__(
        self,
        ui: Any,
        page_input: PageInput,
        pace: Pace,
        buttons: Callable[[], int] = buttons_down,
        is_marked: Callable[[], bool] = is_mark_down,
    ) -> None:
        self._ui = ui
        self._buttons, self._is_marked = buttons, is_marked
        self._input = page_input
        self._pace = pace
        self._next_scene = 0.0
        self._next_try = 0.0
        self._next_panels = 0.0
        self._has_drawn = False
        self.is_drawing = False

    def new_frame(self) -> bool:
        """Begin a frame, of panels or only of the scene; always True."""
        self._input.rest(self._next_scene - time.monotonic())
        # A frame of panels that waits for its turn is begun in time.
        is_wanted = self._has_drawn or self._input.is_click_unseen
        can_wait = self._input.is_alone and not is_wanted
        timeout = LONE_PICTURE_TIMEOUT if can_wait else PICTURE_TIMEOUT
        self._has_drawn |= self._input.wait_for_picture(timeout)
        now = time.monotonic()
        self._next_scene = now + self._pace.scene
        is_due = now >= self._next_panels or self._input.has_clicked
        is_wanted = self._has_drawn or self._input.is_click_unseen
        if (is_wanted and is_due) or self._may_connect(now):
            self._has_drawn = False
            # Panels may see a press, or its end, only in the frame after the one begun for it.
            has_clicked = self._input.has_clicked
            self._next_panels = now + (PANEL_PERIOD if has_clicked else self._pace.panels)
            self._input.has_clicked = False
            self.is_drawing = self._ui.new_frame()
            if self.is_drawing:
                self._input.see(self._buttons(), self._is_marked())
        return True

    def end_frame(self) -> None:
        """End the frame."""
        if self.is_drawing:
            self.is_drawing = False
            self._ui.end_frame()

    def __getattr__(self, name: str) -> Any:
        """Leave everything else to Studio."""
        return getattr(self._ui, name)

    def _may_connect(self, now: float) -> bool:
        """Whether to try to reach a browser: Studio does so when it begins a frame."""
        if self._input.has_source or now < self._next_try:
            return False
        self._next_try = now + CONNECT_PERIOD
        return True
