# SPDX-License-Identifier: Apache-2.0
"""The data of panels."""

from dataclasses import dataclass
from typing import Any

from mujoco.studio.dear_imgui import dear_imgui as imgui
from mujoco_sim.viewer.input import PageInput

from wasd_cockpit.layout import Layout
from wasd_cockpit.link import Link, Push, Snapshot, Stick
from wasd_cockpit.sight import Sight
from wasd_cockpit.widgets import Widgets


@dataclass
class PageState:
    """
    What panels have of the page in the frame that is drawn.

    `held` is what the stick says, `push` with what a hand pushes; `is_live` is whether what is
    held down counts: the browser is alive, and what is down went down since it is; `is_there`
    whether a click is a goal: the same of a browser that may be slow, but was not lost, with one
    finger or a mouse alone.
    """

    link: Link
    widgets: Widgets
    layout: Layout
    sight: Sight
    viewer: Any = None
    input: PageInput | None = None
    snapshot: Snapshot | None = None
    held: Stick | None = None
    push: Push | None = None
    is_live: bool = False
    is_there: bool = False

    def beside_tabs(self, gap: float) -> None:
        """Put what comes next beside the tabs, so far [pixels], where they leave room."""
        if self.layout.is_desk:
            imgui.SameLine(0.0, gap)
