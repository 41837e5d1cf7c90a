# SPDX-License-Identifier: Apache-2.0
"""Widgets of panels: buttons that tell why they are unavailable, texts, and their places."""

from collections.abc import Callable, Iterable, Iterator
import math
from typing import NamedTuple, TypeVar

from mujoco.studio.dear_imgui import dear_imgui as imgui

from wasd_cockpit import style

# A click that is dragged farther [pixels] says a direction, too.
LEAST_DRAG = 12.0
_DISABLED = int(imgui.HoveredFlags.AllowWhenDisabled.value)
_BUTTON = int(imgui.Col.Button.value)
_BUTTON_HOVERED = int(imgui.Col.ButtonHovered.value)
_TEXT = int(imgui.Col.Text.value)

Item = TypeVar('Item')


class Rect(NamedTuple):
    """A rectangle on the page [pixels]."""

    left: float
    top: float
    right: float
    bottom: float

    @property
    def width(self) -> float:
        """Its width."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Its height."""
        return self.bottom - self.top


Place = tuple[float, float]


class Dragging:
    """Watches a pointer that is held down on something, until it is let go."""

    def __init__(self) -> None:
        # Where it was pressed: on the page [pixels], on the floor [m], for which robot.
        self._start: tuple[Place, Place | None, int] | None = None
        self._frame = 0  # in which it was watched last

    def step(
        self, is_held: bool, robot: int, to_floor: Callable[[float, float], Place | None]
    ) -> tuple[Place, Place | None] | None:
        """
        Take whether it is held in this frame, and for which robot.

        Once it is let go, return where on the floor that began [m], and ended: None for a click,
        or the sky. `to_floor` gives the point of the floor at a place of
        the page now: a later frame may show another one there.
        """
        mouse = imgui.GetMousePos().x, imgui.GetMousePos().y
        before, self._frame = self._frame, int(imgui.GetFrameCount())
        if self._frame > before + 1:
            self._start = None  # it may have been let go while it was hidden
        if is_held:
            self._start = self._start or (mouse, to_floor(*mouse), robot)
            return None
        start, self._start = self._start, None
        if start is None or start[1] is None or start[2] != robot:
            return None
        # A hand trembles: a short drag is a click.
        is_click = math.dist(start[0], mouse) <= LEAST_DRAG
        return start[1], None if is_click else to_floor(*mouse)


class Widgets:
    """Draws widgets, and remembers under their names where they were in the last frame."""

    def __init__(self) -> None:
        self.rects: dict[str, Rect] = {}
        self._next: dict[str, Rect] = {}
        self.is_typing = False
        # How much higher what is pressed is, for fingers.
        self.scale = 1.0

    def begin(self) -> None:
        """Begin a frame; one that failed has told nothing."""
        self._next = {}
        self.is_typing = False

    def end(self) -> None:
        """End a frame: what was noted in it is where things are."""
        self.rects = self._next

    def note(self, name: str) -> Rect:
        """Remember and return where the last widget is; `text ...` names one without an action."""
        low, high = imgui.GetItemRectMin(), imgui.GetItemRectMax()
        self._next[name] = rect = Rect(low.x, low.y, high.x, high.y)
        return rect

    def note_field(self, name: str) -> None:
        """Remember where the last widget is, in which one can type: keys are its own then."""
        self.note(name)
        self.is_typing |= bool(imgui.IsItemActive())

    def button(
        self,
        name: str,
        label: str,
        size: tuple[float, float] = (0.0, 0.0),
        *,
        fill: style.Rgb | None = None,
        text: style.Rgb | None = None,
        refusal: str = '',
        at_once: bool = False,
    ) -> bool:
        """
        Draw a button of a size [pixels], 0 as large as it needs; return whether it was pressed.

        A press is one that was let go on it, or that begins, `at_once`. For fingers it is higher
        than that.

        One with a refusal is grey, and says it to the pointer.
        """
        if fill is not None:
            imgui.PushStyleColor(_BUTTON, style.colour(fill))
            imgui.PushStyleColor(_BUTTON_HOVERED, style.colour(fill, 0.85))
        if text is not None:
            imgui.PushStyleColor(_TEXT, style.colour(text))
        if refusal:
            imgui.BeginDisabled(True)
        pressed = bool(imgui.Button(f'{label}##{name}', imgui.Vec2(size[0], self.scale * size[1])))
        pressed = bool(imgui.IsItemActivated()) if at_once else pressed
        if refusal:
            imgui.EndDisabled()
        if fill is not None or text is not None:
            imgui.PopStyleColor(2 * (fill is not None) + (text is not None))
        self.note(name)
        if refusal and imgui.IsItemHovered(_DISABLED):
            imgui.SetTooltip(refusal)
        return pressed and not refusal

    def toggle(
        self, name: str, label: str, is_on: bool, size: tuple[float, float], *, refusal: str = ''
    ) -> bool:
        """Draw a button that is lit while it is on; return whether it was pressed."""
        fill = style.COMMAND if is_on else None
        return self.button(name, label, size, fill=fill, refusal=refusal)

    def heading(self, text: str) -> None:
        """Draw a word above what belongs together."""
        imgui.Spacing()
        self.words(text, style.DIM)

    def words(
        self, text: str, rgb: style.Rgb = style.TEXT, wrapped: bool = False, width: float = 0.0
    ) -> None:
        """Draw words in a colour, broken at the window's edge, `wrapped`, or at a width [px]."""
        imgui.PushStyleColor(_TEXT, style.colour(rgb))
        if wrapped or width:
            room = width - imgui.GetCursorPosX() if width else imgui.GetContentRegionAvail().x
            text = fold(text, room, lambda line: imgui.CalcTextSize(line).x)
            imgui.PushTextWrapPos(width)
        # Not `Text`, for which `%` begins a format.
        imgui.TextUnformatted(text)
        if wrapped or width:
            imgui.PopTextWrapPos()
        imgui.PopStyleColor()


def fold(text: str, width: float, measure: Callable[[str], float]) -> str:
    """Return a text broken between words, for ImGui breaks within them; a longer one stays."""
    lines: list[str] = []
    for whole in text.split('\n'):
        line, *words = [whole] if measure(whole) <= width else whole.split(' ')
        for word in words:
            if measure(f'{line} {word}') <= width:
                line += f' {word}'
            else:
                lines.append(line)
                line = word
        lines.append(line)
    return '\n'.join(lines)


def in_rows(items: Iterable[Item], across: int = 100, gap: float = -1.0) -> Iterator[Item]:
    """Yield items to be drawn side by side, `across` in a row; -1 is the usual gap [pixels]."""
    for index, item in enumerate(items):
        if index % across:
            imgui.SameLine(0.0, gap)
        yield item


def columns(count: int, gap: float = 6.0) -> float:
    """Return the width of one of `count` widgets side by side [pixels]."""
    room = float(imgui.GetContentRegionAvail().x)
    return max(1.0, (room - gap * (count - 1)) / count)
