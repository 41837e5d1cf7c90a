# SPDX-License-Identifier: Apache-2.0
"""How the cockpit looks: colours, one for each thing everywhere, and distances."""

import functools
from typing import Any

from mujoco.studio.dear_imgui import dear_imgui as imgui

Rgb = tuple[int, int, int]

BACKGROUND: Rgb = (17, 20, 26)
PANEL: Rgb = (23, 27, 35)
FRAME: Rgb = (38, 44, 56)
FRAME_HOVERED: Rgb = (50, 58, 74)
LINE: Rgb = (50, 58, 72)
TEXT: Rgb = (224, 229, 236)
DIM: Rgb = (132, 142, 158)
# In plots, on the map and in the scene alike. ImPlot gives out its colours in this order.
COMMAND: Rgb = (76, 155, 232)
ODOMETRY: Rgb = (240, 150, 60)
TRUTH: Rgb = (70, 190, 120)
LIDAR: Rgb = (70, 200, 210)
ESTIMATE: Rgb = (165, 125, 230)
FOOTHOLD: Rgb = (235, 205, 70)
ALARM: Rgb = (214, 62, 62)
LINES: tuple[Rgb, ...] = (COMMAND, ODOMETRY, TRUTH, ALARM)


@functools.cache
def colour(rgb: Rgb, alpha: float = 1.0) -> int:
    """Return a colour as ImGui has it; `alpha` 0 is not seen."""
    r, g, b = rgb
    return round(255 * alpha) << 24 | b << 16 | g << 8 | r


def rgba(rgb: Rgb, alpha: float = 1.0) -> tuple[float, float, float, float]:
    """Return a colour as MuJoCo has it."""
    r, g, b = rgb
    return r / 255.0, g / 255.0, b / 255.0, alpha


def flags(kind: Any, *names: str) -> int:
    """Return the sum of named flags of an enumeration of ImGui or ImPlot."""
    return sum(int(getattr(kind, name).value) for name in names)


# Space around the words of buttons and fields, and half of a field's height [pixels].
PADDING = (8.0, 4.0)
_HALF_FIELD = 11.0

_COLOURS: dict[str, tuple[Rgb, float]] = {
    'Text': (TEXT, 1.0),
    'TextDisabled': (DIM, 1.0),
    'WindowBg': (PANEL, 0.97),
    'ChildBg': (PANEL, 0.0),
    'PopupBg': (FRAME, 1.0),
    'Border': (LINE, 1.0),
    'FrameBg': (FRAME, 1.0),
    'FrameBgHovered': (FRAME_HOVERED, 1.0),
    'FrameBgActive': (FRAME_HOVERED, 1.0),
    'Button': (FRAME, 1.0),
    'ButtonHovered': (FRAME_HOVERED, 1.0),
    'ButtonActive': (COMMAND, 1.0),
    'CheckMark': (COMMAND, 1.0),
    'SliderGrab': (COMMAND, 1.0),
    'SliderGrabActive': (COMMAND, 1.0),
    'PlotHistogram': (COMMAND, 1.0),
    'Header': (FRAME_HOVERED, 1.0),
    'HeaderHovered': (FRAME_HOVERED, 1.0),
    'HeaderActive': (COMMAND, 1.0),
    'ScrollbarBg': (PANEL, 0.0),
    'ScrollbarGrab': (LINE, 1.0),
}
_PUSHED = tuple(
    (int(getattr(imgui.Col, name).value), colour(*value)) for name, value in _COLOURS.items()
)
_SIZES: dict[str, float | tuple[float, float]] = {
    'WindowRounding': 0.0,
    'FrameRounding': 4.0,
    'GrabRounding': 4.0,
    'WindowBorderSize': 1.0,
    'FrameBorderSize': 0.0,
    'WindowPadding': (10.0, 8.0),
    'ItemSpacing': (6.0, 4.0),
    'DisabledAlpha': 0.45,
}
_VALUES = tuple(
    (int(getattr(imgui.StyleVar, name).value), value) for name, value in _SIZES.items()
)


def push_theme(scale: float = 1.0) -> None:
    """Let all that follows look like the cockpit, fields `scale` as high, until `pop_theme`."""
    for index, value in _PUSHED:
        imgui.PushStyleColor(index, value)
    for index, size in _VALUES:
        imgui.PushStyleVar(index, size if isinstance(size, float) else imgui.Vec2(*size))
    push_padding(PADDING[0], PADDING[1] + _HALF_FIELD * (scale - 1.0))


def push_padding(x: float, y: float) -> None:
    """Push ImGui's frame padding [pixels]; pop it afterwards."""
    imgui.PushStyleVar(int(imgui.StyleVar.FramePadding.value), imgui.Vec2(x, y))


def pop_theme() -> None:
    """Let things look as before."""
    imgui.PopStyleVar(len(_VALUES) + 1)
    imgui.PopStyleColor(len(_PUSHED))
