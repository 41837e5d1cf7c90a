# SPDX-License-Identifier: Apache-2.0
"""Panels at the pace of the browser that shows them: none is sent that would have to queue."""

import time
from typing import Any

from mujoco_sim.page_input import PageInput

# The scene is sent at least this often [s], whatever the panels do.
SCENE_PERIOD = 1.0 / 60.0
# How often it is tried to reach a browser that has not been heard yet [s].
CONNECT_PERIOD = 0.2


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
