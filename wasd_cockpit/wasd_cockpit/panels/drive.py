# SPDX-License-Identifier: Apache-2.0
"""The panels Drive and Keys: a stick for mouse and finger, and what each key does."""

import math

from mujoco.studio.dear_imgui import dear_imgui as imgui

from wasd_cockpit import style
from wasd_cockpit.link import Order, Snapshot, Stick
from wasd_cockpit.panels.page_panel import PageState
from wasd_cockpit.widgets import columns, Rect

# What is nearer to the middle than this share of the way is no wish.
DEAD_ZONE = 0.08
LEAST_SHARE = 0.05
_LARGEST_PAD, _SMALLEST_PAD = 250.0, 90.0
_KNOB, _BAR = 16.0, 26.0
# What is below the pad [pixels].
_BELOW = 112.0
CANNOT_HOLD = 'page too slow to hold the stick: drive by keys'
# A key's button.
_CAP, _HEIGHT = 58.0, 22.0
_NAMES = {' ': 'SPACE'}


def deflection(x: float, y: float) -> tuple[float, float]:
    """
    Return the deflection of a stick, within the unit circle, of a knob's place in radii.

    It begins at the edge of the dead zone, without a jump.
    """
    length = math.hypot(x, y)
    if not math.isfinite(length) or length <= DEAD_ZONE:
        return 0.0, 0.0
    share = (min(length, 1.0) - DEAD_ZONE) / (1.0 - DEAD_ZONE) / length
    return share * x, share * y


class Drive:
    """Holds the stick while a finger or a mouse button does; letting go is the end of it."""

    def __init__(self) -> None:
        self.share = 0.5
        self.turns_sideways = False

    def draw(self, page: PageState, snapshot: Snapshot) -> None:
        """Draw it in the window that is open."""
        use = snapshot.stick
        turns = self.turns_sideways or not use.sideways
        x, y = self._draw_pad(page)
        turn = self._draw_turn(page)
        stick = Stick(y, 0.0, -x) if turns else Stick(y, -x, 0.0)
        stick = stick._replace(turn=min(max(stick.turn + turn, -1.0), 1.0))
        scaled = Stick(*(self.share * value for value in stick))
        velocity = (value + 0.0 for value in use.velocity(scaled))
        text = '{:+.2f} {:+.2f} m/s  {:+.2f} rad/s'.format(*velocity)
        if page.input is not None and not page.input.can_hold:
            page.widgets.words(CANNOT_HOLD, style.ODOMETRY, wrapped=True)
            page.widgets.note('text cannot hold')
        else:
            page.widgets.words(text if any(use.full) else use.words, style.DIM, wrapped=True)
        imgui.SetNextItemWidth(columns(1))
        label = 'full stick: %.2f of full speed'
        _, share = imgui.SliderFloat('##share', self.share, LEAST_SHARE, 1.0, label)
        self.share = min(max(LEAST_SHARE, share), 1.0)  # what is typed may be any number, or none
        page.widgets.note_field('share')
        if use.sideways:
            width = columns(2)
            if page.widgets.toggle('left is left', 'left is left', not turns, (width, 0.0)):
                self.turns_sideways = False
            imgui.SameLine()
            if page.widgets.toggle('left is turn', 'left is turn', turns, (width, 0.0)):
                self.turns_sideways = True
        if self._is_held:
            page.held = scaled

    def _draw_pad(self, page: PageState) -> tuple[float, float]:
        """Return where the knob is: to the right and up, in [-1, 1]."""
        room = imgui.GetContentRegionAvail()
        size = max(min(room.x, room.y - page.widgets.scale * _BELOW, _LARGEST_PAD), _SMALLEST_PAD)
        imgui.SetCursorPosX(imgui.GetCursorPosX() + 0.5 * max(0.0, room.x - size))
        imgui.InvisibleButton('pad', imgui.Vec2(size, size))
        rect = page.widgets.note('pad')
        radius = 0.5 * size - 4.0
        self._is_held = bool(imgui.IsItemActive()) and page.is_live
        knob = (0.0, 0.0)
        if self._is_held:
            mouse = imgui.GetMousePos()
            cx, cy = 0.5 * (rect.left + rect.right), 0.5 * (rect.top + rect.bottom)
            knob = deflection((mouse.x - cx) / radius, (cy - mouse.y) / radius)
        self._paint_pad(rect, radius, knob)
        return knob

    def _paint_pad(self, rect: Rect, radius: float, knob: tuple[float, float]) -> None:
        drawing = imgui.GetWindowDrawList()
        cx, cy = 0.5 * (rect.left + rect.right), 0.5 * (rect.top + rect.bottom)
        middle, line = imgui.Vec2(cx, cy), style.colour(style.LINE)
        drawing.AddCircleFilled(middle, radius, style.colour(style.BACKGROUND), 48)
        drawing.AddCircle(middle, radius, line, 48, 2.0)
        drawing.AddCircle(middle, 0.5 * radius, line, 32)
        for dx, dy in ((radius, 0.0), (0.0, radius)):
            drawing.AddLine(imgui.Vec2(cx - dx, cy - dy), imgui.Vec2(cx + dx, cy + dy), line)
        place = imgui.Vec2(cx + radius * knob[0], cy - radius * knob[1])
        fill = style.COMMAND if self._is_held else style.FRAME_HOVERED
        drawing.AddCircleFilled(place, _KNOB, style.colour(fill), 24)

    def _draw_turn(self, page: PageState) -> float:
        """Return how much the bar below the pad turns, counter-clockwise, in [-1, 1]."""
        width = columns(1)
        imgui.InvisibleButton('turning', imgui.Vec2(width, page.widgets.scale * _BAR))
        rect = page.widgets.note('turning')
        half = 0.5 * width - _KNOB
        cx, cy = 0.5 * (rect.left + rect.right), 0.5 * (rect.top + rect.bottom)
        is_held = bool(imgui.IsItemActive()) and page.is_live
        share = 0.0
        if is_held:
            share, _ = deflection((imgui.GetMousePos().x - cx) / half, 0.0)
            self._is_held = True
        drawing = imgui.GetWindowDrawList()
        bar = (imgui.Vec2(rect.left, cy - 4.0), imgui.Vec2(rect.right, cy + 4.0))
        drawing.AddRectFilled(*bar, style.colour(style.BACKGROUND), 4.0)
        fill = style.COMMAND if is_held else style.FRAME_HOVERED
        drawing.AddCircleFilled(imgui.Vec2(cx + half * share, cy), 11.0, style.colour(fill), 20)
        return -share


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
