# SPDX-License-Identifier: Apache-2.0
"""What panels are shown of a mouse, whose clicks may come faster than frames."""

from typing import NamedTuple

# ImGui's numbers of the buttons of a mouse, and a bit for each.
BUTTONS = range(5)
ALL_BUTTONS = (1 << len(BUTTONS)) - 1
# So many changes of the mouse's buttons wait for frames of panels, and a frame has so long to see
# one [s].
MOST_CHANGES, CHANGE_PATIENCE = 6, 2.0
# A click waits so long for keys that were pressed before it [s].
KEY_PATIENCE = 5.0
# Left, top, right, bottom [pixels].
Box = tuple[float, float, float, float]


class Mouse(NamedTuple):
    """A bit for each button of a mouse that is down, and where its pointer is [pixels]."""

    buttons: int = 0
    place: tuple[int, int] = (0, 0)

    def presses(self, box: Box | None) -> bool:
        """Whether a button is down in a box."""
        if box is None or not self.buttons:
            return False
        (x, y), (left, top, right, bottom) = self.place, box
        return left <= x < right and top <= y < bottom


# No button is down.
IDLE = Mouse()
# Off the page: what is let go there is no click.
NOWHERE = (-1, -1)


class Clicks:
    """
    Shows the panels one change of a mouse's buttons at a time.

    NetImgui hands each frame of panels the latest input alone: a tap shorter than a frame would
    get lost, and a press would move with a pointer that goes on at once. So a change stays where
    it was made until a frame has seen it; later changes wait. If clicks come faster than frames,
    whole clicks are left out, but not the first and the last. Keys, and whether the page is
    there, do not wait. This class reads no clock.
    """

    def __init__(self) -> None:
        self.shown = Mouse()
        self._seen = 0
        self._age = 0.0
        self._told = 0
        self._waiting: list[Mouse] = []

    @property
    def is_seen(self) -> bool:
        """Whether a frame of panels has seen the buttons that are shown."""
        return self._seen == self.shown.buttons

    def see(self, buttons: int) -> None:
        """Take which buttons a frame of panels has seen down."""
        self._seen = buttons

    def forget(self) -> None:
        """Let nothing wait: what is told next is shown."""
        self._waiting.clear()
        self._told = self._seen
        self.shown = Mouse(self._seen, self.shown.place)

    def change_page(self) -> None:
        """
        Show what the panels still see down of a page that is gone, then that it is up.

        A new page, which holds nothing, has changed nothing for NetImgui: the panels would have
        that button down until the end of its next press, which would press nothing.
        """
        if self._seen:
            self.shown, self._age = Mouse(self._seen, NOWHERE), 0.0
            self._waiting = [Mouse(0, NOWHERE)]
            self._told, self._seen = 0, 0

    def show(
        self, told: Mouse, dt: float, waits: bool = False, e_stop: Box | None = None
    ) -> Mouse:
        """
        Take how the mouse is, `dt` [s] after the last time; return what is to be seen of it.

        It `waits` for keys that a frame is to see before, but not where it presses the E-STOP.
        """
        told = Mouse(told.buttons & ALL_BUTTONS, told.place)
        self._age += dt
        if told.buttons != self._told:
            if waits and not self._waiting:
                self._age = 0.0
            self._told = told.buttons
            self._waiting.append(told)
            self._thin_out()
        waits = waits and not any(mouse.presses(e_stop) for mouse in self._waiting)
        patience = KEY_PATIENCE if self.is_seen else CHANGE_PATIENCE
        if (self.is_seen and not waits) or self._age > patience:
            if self._waiting:
                self.shown, self._age = self._waiting.pop(0), 0.0
            else:
                self.shown = told
        return self.shown

    def _thin_out(self) -> None:
        """Leave out a click in the middle of those that wait, if these are too many."""
        if len(self._waiting) <= MOST_CHANGES:
            return
        buttons = [mouse.buttons for mouse in self._waiting]
        for index in range(1, len(buttons) - 2):
            # A press and its end: the end of one and the next press would be a click elsewhere.
            if buttons[index] & ~buttons[index - 1] and buttons[index - 1] == buttons[index + 1]:
                del self._waiting[index : index + 2]
                return
        del self._waiting[-2]
