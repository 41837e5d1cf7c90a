# SPDX-License-Identifier: Apache-2.0
"""What is drawn over the scene: panels, of which one that fails costs nothing but itself."""

from collections.abc import Callable, Sequence
import logging
from typing import NamedTuple

from mujoco.studio import ux
from mujoco.studio.dear_imgui import dear_imgui as imgui

_OVERLAY = (
    imgui.WindowFlags.NoDecoration.value
    | imgui.WindowFlags.AlwaysAutoResize.value
    | imgui.WindowFlags.NoInputs.value
)
_EDGE = 12.0  # [pixels]
_LOG = logging.getLogger(__name__)


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
