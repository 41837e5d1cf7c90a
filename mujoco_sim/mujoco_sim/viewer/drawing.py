# SPDX-License-Identifier: Apache-2.0
"""What is drawn for the browser: panels, and as much and as often as it can take."""

from collections.abc import Callable, Sequence
import logging
import time
from typing import Any, NamedTuple

import mujoco
from mujoco.studio import ux
from mujoco.studio.dear_imgui import dear_imgui as imgui

from mujoco_sim.viewer.input import PageInput

_OVERLAY = (
    imgui.WindowFlags.NoDecoration.value
    | imgui.WindowFlags.AlwaysAutoResize.value
    | imgui.WindowFlags.NoInputs.value
)
_EDGE = 12.0  # [pixels]
_LOG = logging.getLogger(__name__)

# A browser that draws so many plain pictures a second, for so long [s], gets detailed ones.
FAST, FAST_FOR = 20, 3.0
# One that then draws fewer than this a second, for so long [s], gets plain ones again.
SLOW, SLOW_FOR = 10, 3.0

# Not post-processing: without it colours are wrong, and too dark.
_COSTLY = (int(mujoco.mjtRndFlag.mjRND_SHADOW), int(mujoco.mjtRndFlag.mjRND_REFLECTION))

# The scene is sent at least this often [s], whatever the panels do.
SCENE_PERIOD = 1.0 / 60.0
# How often it is tried to reach a browser that has not been heard yet [s].
CONNECT_PERIOD = 0.2


class Panel(NamedTuple):
    """Text on the page: `status` is asked for every frame, `help` unfolds on a click."""

    status: Callable[[], Sequence[str]]
    help: Sequence[str]


class Panels:
    """
    Draws panels in order, each with its function.

    One that raises is logged, once, and says in its place that it failed; the run goes on.
    """

    def __init__(self, draw: dict[str, Callable[[], None]]) -> None:
        """Take a function per name; it is called between the frame's begin and end."""
        self._draw = draw
        self.failed: set[str] = set()

    def draw(self) -> None:
        """Draw all of them."""
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
        if self.failed:
            draw_lines('failed', [f'panel {name} failed' for name in sorted(self.failed)], 0.4)


def draw_lines(name: str, lines: Sequence[str], height: float = 0.0) -> None:
    """Draw lines at the left edge, at a height of the page from 0 (top) to 1."""
    top = _EDGE + height * imgui.GetIO().DisplaySize.y
    imgui.SetNextWindowPos(imgui.Vec2(_EDGE, top), imgui.Cond.Always)
    imgui.SetNextWindowBgAlpha(0.6)
    imgui.Begin(name, flags=_OVERLAY)
    for line in lines:
        imgui.Text(line)
    imgui.End()


def draw_help(lines: Sequence[str], lines_above: int) -> None:
    """Draw lines that stay folded until the user wants them: the robot is to be seen."""
    below = 30.0 + imgui.GetTextLineHeightWithSpacing() * (lines_above + 0.5)
    imgui.SetNextWindowPos(imgui.Vec2(_EDGE, below), imgui.Cond.FirstUseEver)
    imgui.SetNextWindowCollapsed(True, imgui.Cond.FirstUseEver)
    imgui.SetNextWindowBgAlpha(0.8)
    imgui.Begin('keys (double-click)', flags=imgui.WindowFlags.AlwaysAutoResize)
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


class PacedUi:
    """
    Studio's headless user interface, which would build a frame whether it can be shown or not.

    A frame of panels is begun only when the browser has drawn since the last one, so what it
    shows is never older than two of its own pictures; with no browser there is none.
    """

    def __init__(self, ui: Any, page_input: PageInput) -> None:
        self._ui = ui
        self._input = page_input
        self._next_try = 0.0
        self.is_drawing = False

    def new_frame(self) -> bool:
        """Begin a frame, of panels or only of the scene; always True."""
        if self._input.wait_for_picture(SCENE_PERIOD) or self._may_connect():
            self.is_drawing = self._ui.new_frame()
        return True

    def end_frame(self) -> None:
        """End the frame."""
        if self.is_drawing:
            self.is_drawing = False
            self._ui.end_frame()

    def __getattr__(self, name: str) -> Any:
        """Leave everything else to Studio."""
        return getattr(self._ui, name)

    def _may_connect(self) -> bool:
        """Whether to try to reach a browser: Studio does so when it begins a frame."""
        now = time.monotonic()
        if self._input.has_source or now < self._next_try:
            return False
        self._next_try = now + CONNECT_PERIOD
        return True
