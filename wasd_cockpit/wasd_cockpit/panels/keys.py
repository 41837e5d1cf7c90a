# SPDX-License-Identifier: Apache-2.0
"""The panel Keys: what each key does, the pressed ones lit; a click is a press."""

from mujoco.studio.dear_imgui import dear_imgui as imgui

from wasd_cockpit import style
from wasd_cockpit.page_state import PageState
from wasd_cockpit.snapshot import Order
from wasd_cockpit.snapshot import Snapshot

_CAP, _HEIGHT = 58.0, 22.0
_NAMES = {' ': 'SPACE'}


class Keys:
    """Shows the keymap."""

    def draw(self, page: PageState, snapshot: Snapshot) -> None:
        """Draw it in the window that is open."""
        page.widgets.words('Click the scene, then press; or click a key.', style.DIM, wrapped=True)
        for cap in snapshot.keys:
            name = _NAMES.get(cap.key, cap.key)
            is_lit = cap.key in snapshot.lit
            if page.widgets.toggle(f'key {name}', name, is_lit, (_CAP, _HEIGHT)):
                page.link.order(Order('key', cap.key))
            imgui.SameLine()
            imgui.AlignTextToFramePadding()
            page.widgets.words(cap.does, style.TEXT if is_lit else style.DIM)
