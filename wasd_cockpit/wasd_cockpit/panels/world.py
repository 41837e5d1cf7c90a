# SPDX-License-Identifier: Apache-2.0
"""The panel World: another robot or another world, for which the run starts anew."""

from mujoco.studio.dear_imgui import dear_imgui as imgui

from wasd_cockpit import style
from wasd_cockpit.page_state import PageState
from wasd_cockpit.snapshot import Order
from wasd_cockpit.snapshot import Snapshot
from wasd_cockpit.widgets import columns

_HEIGHT = 24.0


class World:
    """Chooses; nothing happens until `start anew` is pressed."""

    def __init__(self) -> None:
        self._chosen: dict[str, str] = {}

    def draw(self, page: PageState, snapshot: Snapshot) -> None:
        """Draw it in the window that is open."""
        start = snapshot.start
        now = {'robot': start.robot, 'world': start.world}
        for what, options in (('robot', start.robots), ('world', start.worlds)):
            page.widgets.heading(what.upper())
            self._draw_options(page, what, options, now[what])
        chosen = {**now, **self._chosen}
        same = '' if chosen != now else 'this is what runs: choose another robot or world'
        imgui.Spacing()
        if page.widgets.button(
            'start anew',
            'start anew',
            (columns(1), 28.0),
            fill=style.COMMAND if chosen != now else None,
            refusal=start.refusal or same,
        ):
            page.link.order(Order('start', f'{chosen["robot"]} {chosen["world"]}'))
        words = f'{start.called} {chosen["robot"]} --world {chosen["world"]}'
        page.widgets.words(words, wrapped=True)
        why = start.refusal or 'What runs ends; the page comes back by itself.'
        page.widgets.words(why, style.DIM, wrapped=True)

    def _draw_options(
        self, page: PageState, what: str, options: tuple[str, ...], now: str
    ) -> None:
        width = columns(3)
        for index, option in enumerate(options):
            if index % 3:
                imgui.SameLine()
            is_on = option == self._chosen.get(what, now)
            # Of a file its name, which tells most.
            label = option.rpartition('/')[2]
            if page.widgets.toggle(f'next {what} {option}', label, is_on, (width, _HEIGHT)):
                self._chosen[what] = option
