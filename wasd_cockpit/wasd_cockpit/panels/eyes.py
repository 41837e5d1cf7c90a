# SPDX-License-Identifier: Apache-2.0
"""The panel Eyes: what the front of the robot sees, the depth in a corner."""

from mujoco.studio.dear_imgui import dear_imgui as imgui

from wasd_cockpit import style
from wasd_cockpit.page_state import PageState
from wasd_cockpit.sight import SIZE
from wasd_cockpit.snapshot import Snapshot


class Eyes:
    """Shows pictures while they are wanted: they are 1.5 MB a second."""

    def __init__(self) -> None:
        self.is_on = False
        self._texture = 0
        self._shown = 0

    def draw(self, page: PageState, snapshot: Snapshot) -> None:
        """Draw it in the window that is open."""
        page.beside_tabs(16.0)
        label = 'pictures on' if self.is_on else 'pictures off'
        if page.widgets.toggle('pictures', label, self.is_on, (0.0, 26.0)):
            self.is_on = not self.is_on
        if page.sight.failure:
            page.widgets.words(page.sight.failure, style.ODOMETRY, wrapped=True)
            return
        if not self.is_on:
            page.widgets.words(
                'Five pictures a second are 1.5 MB.',
                style.DIM,
                wrapped=True,
            )
            return
        page.sight.want('picture')
        seen = page.sight.seen
        if seen.picture is not None and seen.number != self._shown:
            self._shown = seen.number
            self._texture = page.viewer.upload_image(self._texture, seen.picture, *SIZE, 4)
        if not self._texture:
            page.widgets.words('looking ...', style.DIM)
            return
        room = imgui.GetContentRegionAvail()
        width = max(min(room.x, room.y * SIZE[0] / SIZE[1]), 32.0)
        imgui.Image(self._texture, imgui.Vec2(width, width * SIZE[1] / SIZE[0]))
        page.widgets.note('picture')
