# SPDX-License-Identifier: Apache-2.0
"""The panel Map: the floor from above around the robot, its trail, and what rays hit."""

import math
from typing import TYPE_CHECKING

from mujoco.studio.dear_imgui import dear_imgui as imgui
import numpy as np

from wasd_cockpit import style
from wasd_cockpit.snapshot import PlanarPose
from wasd_cockpit.snapshot import Snapshot
from wasd_cockpit.widgets import Rect

if TYPE_CHECKING:
    from wasd_cockpit.cockpit import PageState

# How much of the floor is seen [m], from middle to edge.
REACHES = (1.0, 2.0, 4.0, 8.0, 16.0)
MOST_TRAIL = 120
# Lines of the floor are one of these apart [m], and at least so far where one is enough [pixels].
GRID_STEPS, LEAST_GAP = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0), 22.0


class View:
    """Where points of the floor [m] are on the page [pixels]: x to the right, y up."""

    def __init__(self, rect: Rect, pose: PlanarPose, reach: float) -> None:
        self._cx, self._cy = 0.5 * (rect.left + rect.right), 0.5 * (rect.top + rect.bottom)
        self.scale = 0.5 * min(rect.width, rect.height) / reach
        self._pose = pose

    def to_page(self, x: float, y: float) -> tuple[float, float]:
        """Return where a point of the floor is on the page."""
        scale = self.scale
        return self._cx + scale * (x - self._pose.x), self._cy - scale * (y - self._pose.y)

    def to_floor(self, x: float, y: float) -> tuple[float, float]:
        """Return which point of the floor is at a place of the page."""
        scale = self.scale
        return self._pose.x + (x - self._cx) / scale, self._pose.y - (y - self._cy) / scale


def grid_step(scale: float) -> float:
    """Return how far apart lines [m] are to be that are not too dense at a scale [pixels/m]."""
    return next((step for step in GRID_STEPS if step * scale > LEAST_GAP), GRID_STEPS[-1])


class Map:
    """Draws the floor from above."""

    def __init__(self) -> None:
        self.zoom = 2

    def draw(self, page: 'PageState', snapshot: Snapshot) -> None:
        """Draw it in the window that is open."""
        for name, label, step in (('closer', '+', -1), ('farther', '-', 1)):
            imgui.SameLine(0.0, 8.0)
            if page.widgets.button(f'map {name}', label, (28.0, 26.0)):
                self.zoom = min(max(self.zoom + step, 0), len(REACHES) - 1)
        imgui.SameLine(0.0, 12.0)
        imgui.AlignTextToFramePadding()
        pose = snapshot.pose
        page.widgets.words(f'x {pose.x:+.2f}  y {pose.y:+.2f} m', style.DIM)
        page.sight.want('ranges')
        room = imgui.GetContentRegionAvail()
        imgui.InvisibleButton('floor', imgui.Vec2(max(room.x, 40.0), max(room.y, 40.0)))
        page.widgets.note('floor')
        low, high = imgui.GetItemRectMin(), imgui.GetItemRectMax()
        rect = Rect(low.x, low.y, high.x, high.y)
        drawing = imgui.GetWindowDrawList()
        drawing.AddRectFilled(low, high, style.colour(style.BACKGROUND), 4.0)
        imgui.PushClipRect(low, high, True)
        view = View(rect, pose, REACHES[self.zoom])
        self._paint_grid(rect, view)
        self._paint_points(page.sight.seen.points, rect, view)
        self._paint_trail(snapshot.trail, view)
        self._paint_robot(snapshot, view)
        imgui.PopClipRect()

    def _paint_grid(self, rect: Rect, view: View) -> None:
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

    def _paint_points(self, points: np.ndarray, rect: Rect, view: View) -> None:
        drawing, fill = imgui.GetWindowDrawList(), style.colour(style.LIDAR)
        for x, y in points.tolist():
            px, py = view.to_page(x, y)
            if rect.left < px < rect.right and rect.top < py < rect.bottom:
                drawing.AddRectFilled(
                    imgui.Vec2(px - 2.0, py - 2.0), imgui.Vec2(px + 2.0, py + 2.0), fill
                )

    def _paint_trail(self, trail: np.ndarray, view: View) -> None:
        if len(trail) < 2:
            return
        every = max(1, -(-len(trail) // MOST_TRAIL))
        places = [imgui.Vec2(*view.to_page(x, y)) for x, y in trail[::-1][::every].tolist()]
        imgui.GetWindowDrawList().AddPolyline(places, style.colour(style.TRUTH), 2.0)

    def _paint_robot(self, snapshot: Snapshot, view: View) -> None:
        """Paint an arrow as large as the robot, but one that is seen."""
        size = max(snapshot.marks.size * view.scale, 9.0)
        x, y = view.to_page(snapshot.pose.x, snapshot.pose.y)
        corners = []
        for turn, length in ((0.0, 1.0), (2.5, 0.8), (math.pi, 0.3), (-2.5, 0.8)):
            angle = snapshot.pose.yaw + turn
            place = x + length * size * math.cos(angle), y - length * size * math.sin(angle)
            corners.append(imgui.Vec2(*place))
        drawing, fill = imgui.GetWindowDrawList(), style.colour(style.COMMAND)
        drawing.AddTriangleFilled(corners[0], corners[1], corners[2], fill)
        drawing.AddTriangleFilled(corners[0], corners[2], corners[3], fill)
