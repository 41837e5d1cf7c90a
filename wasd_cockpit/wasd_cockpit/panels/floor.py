# SPDX-License-Identifier: Apache-2.0
"""The floor from above on the page: where its points are; pictures, lines and a robot on it."""

import math

from mujoco.studio.dear_imgui import dear_imgui as imgui
import numpy as np

from wasd_cockpit import style
from wasd_cockpit.link import PlanarPose
from wasd_cockpit.widgets import Rect

# Lines of the floor are one of these apart [m], and at least so far where one is enough [pixels].
GRID_STEPS, LEAST_GAP = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0), 22.0


class FloorView:
    """Where points of the floor [m] are on the page [pixels]: x to the right, y up."""

    def __init__(self, rect: Rect, pose: PlanarPose, reach: float) -> None:
        self._cx, self._cy = 0.5 * (rect.left + rect.right), 0.5 * (rect.top + rect.bottom)
        self.scale = 0.5 * min(rect.width, rect.height) / reach
        self._pose = pose

    def to_page(self, x: float, y: float) -> tuple[float, float]:
        """Return where a point of the floor is on the page."""
        scale = self.scale
        return self._cx + scale * (x - self._pose.x), self._cy - scale * (y - self._pose.y)

    def all_to_page(self, points: np.ndarray) -> np.ndarray:
        """Return where points (n, 2) of the floor are on the page, (n, 2)."""
        start = self._pose.x, self._pose.y
        return np.asarray((points - start) * (self.scale, -self.scale) + (self._cx, self._cy))

    def to_floor(self, x: float, y: float) -> tuple[float, float]:
        """Return which point of the floor is at a place of the page."""
        scale = self.scale
        return self._pose.x + (x - self._cx) / scale, self._pose.y - (y - self._cy) / scale


def grid_step(scale: float) -> float:
    """Return how far apart lines [m] are to be that are not too dense at a scale [pixels/m]."""
    return next((step for step in GRID_STEPS if step * scale > LEAST_GAP), GRID_STEPS[-1])


def paint_image(
    texture: int,
    corner: tuple[float, float],
    size: tuple[float, float],
    rect: Rect,
    view: FloorView,
) -> None:
    """Paint what is in sight of a picture, y up, of a part of the floor: its corner, size [m]."""
    left, bottom = view.to_page(*corner)
    right, top = view.to_page(corner[0] + size[0], corner[1] + size[1])
    seen = Rect(
        max(left, rect.left),
        max(top, rect.top),
        min(right, rect.right),
        min(bottom, rect.bottom),
    )
    if seen.width <= 0.0 or seen.height <= 0.0:
        return
    shares = [
        imgui.Vec2((px - left) / (right - left), (py - top) / (bottom - top))
        for px, py in ((seen.left, seen.top), (seen.right, seen.bottom))
    ]
    imgui.SetCursorScreenPos(imgui.Vec2(seen.left, seen.top))
    imgui.Image(texture, imgui.Vec2(seen.width, seen.height), *shares)


def paint_grid(rect: Rect, view: FloorView) -> None:
    """Paint lines that are not too dense."""
    drawing, line = imgui.GetWindowDrawList(), style.colour(style.LINE, 0.6)
    step = grid_step(view.scale)
    left, top = view.to_floor(rect.left, rect.top)
    right, bottom = view.to_floor(rect.right, rect.bottom)
    for number in range(math.ceil(left / step), math.floor(right / step) + 1):
        x, _ = view.to_page(number * step, 0.0)
        drawing.AddLine(imgui.Vec2(x, rect.top), imgui.Vec2(x, rect.bottom), line)
    for number in range(math.ceil(bottom / step), math.floor(top / step) + 1):
        _, y = view.to_page(0.0, number * step)
        drawing.AddLine(imgui.Vec2(rect.left, y), imgui.Vec2(rect.right, y), line)


def paint_robot(size: float, pose: PlanarPose, view: FloorView) -> None:
    """Paint an arrow as large as the robot, but one that is seen."""
    size = max(size * view.scale, 9.0)
    x, y = view.to_page(pose.x, pose.y)
    corners = []
    for turn, length in ((0.0, 1.0), (2.5, 0.8), (math.pi, 0.3), (-2.5, 0.8)):
        angle = pose.yaw + turn
        place = x + length * size * math.cos(angle), y - length * size * math.sin(angle)
        corners.append(imgui.Vec2(*place))
    drawing, fill = imgui.GetWindowDrawList(), style.colour(style.COMMAND)
    drawing.AddTriangleFilled(corners[0], corners[1], corners[2], fill)
    drawing.AddTriangleFilled(corners[0], corners[2], corners[3], fill)
