# SPDX-License-Identifier: Apache-2.0
"""
The panel Map: the floor from above around the robot, its trail, and what rays hit.

With a navigator it is the robot's map, in its axes, and a click is a goal.
"""

import math

from mujoco.studio.dear_imgui import dear_imgui as imgui
import numpy as np

from wasd_cockpit import style
from wasd_cockpit.link import moved, Navigation, navigation_words, Order, Snapshot
from wasd_cockpit.panels.floor import FloorView, paint_grid, paint_image, paint_robot
from wasd_cockpit.panels.page_panel import PageState
from wasd_cockpit.widgets import Dragging, in_rows, Rect

# How much of the floor is seen [m], from middle to edge.
REACHES = (1.0, 2.0, 4.0, 8.0, 16.0)
MOST_TRAIL = 80

# Grey of what is free; what nobody has seen is left out.
FREE_GREY: style.Rgb = (62, 70, 86)
# Cells of more than this are kept out of, and painted so.
OCCUPIED = 100
KEEPOUT_RED: style.Rgb = (122, 52, 58)


def paint_cells(cells: np.ndarray) -> bytes:
    """Return the picture of a grid, y up: rgba bytes, a pixel for each cell."""
    known = cells[::-1] >= 0
    share = np.clip(cells[::-1], 0, 100)[..., None] / 100.0
    image = np.zeros((*cells.shape, 4), dtype=np.uint8)
    image[..., :3] = (1.0 - share) * FREE_GREY + share * style.TEXT
    image[cells[::-1] > OCCUPIED, :3] = KEEPOUT_RED
    image[..., 3] = 255 * known
    return image.tobytes()


class Map:
    """Draws the floor from above."""

    def __init__(self) -> None:
        self.zoom = 2
        self._texture = 0
        self._painted: int | None = None
        self._dragging = Dragging()

    def draw(self, page: PageState, snapshot: Snapshot) -> None:
        """Draw it in the window that is open."""
        navigation = snapshot.navigation
        page.beside_tabs(8.0)
        for name, label, step in in_rows((('closer', '+', -1), ('farther', '-', 1)), gap=8.0):
            if page.widgets.button(f'map {name}', label, (28.0 * page.widgets.scale, 26.0)):
                self.zoom = min(max(self.zoom + step, 0), len(REACHES) - 1)
        pose = snapshot.pose if navigation is None else navigation.pose
        if navigation is not None:
            self._draw_orders(page, navigation)
        else:
            imgui.SameLine(0.0, 12.0)
            imgui.AlignTextToFramePadding()
            page.widgets.words(f'x {pose.x:+.2f}  y {pose.y:+.2f} m', style.DIM)
        page.sight.want('ranges')
        rect, is_held = self._draw_floor(page)
        low, high = imgui.Vec2(rect.left, rect.top), imgui.Vec2(rect.right, rect.bottom)
        imgui.PushClipRect(low, high, True)
        view = FloorView(rect, pose, REACHES[self.zoom])
        if navigation is not None:
            self._paint_map(page, navigation, rect, view)
        # A click is a goal; a drag from there is the way to look.
        drag = self._dragging.step(
            is_held, snapshot.robot, lambda x, y: view.to_floor(x, y) if navigation else None
        )
        if drag is not None and page.is_there:
            page.link.order(Order.goal(*drag))
        paint_grid(rect, view)
        points, trail = page.sight.seen.points, snapshot.trail
        if navigation is not None:
            points, trail = (moved(places, snapshot.pose, pose) for places in (points, trail))
        self._paint_points(points, rect, view)
        self._paint_trail(trail, view)
        if navigation is not None:
            self._paint_way(navigation, view)
        paint_robot(snapshot.marks.size, pose, view)
        imgui.PopClipRect()

    def _draw_orders(self, page: PageState, navigation: Navigation) -> None:
        """Draw the buttons of a navigator, and what it does."""
        is_under_way = navigation.goal is not None or navigation.is_following
        for what, refusal in (
            ('save map', ''),
            ('cancel goal', '' if is_under_way else 'there is no goal'),
            ('explore', navigation.no_exploring),
        ):
            # On a desk tabs leave no room for them.
            if what != 'save map' or not page.layout.is_desk:
                imgui.SameLine(0.0, 8.0)
            if page.widgets.button(what, what, (0.0, 26.0), refusal=refusal):
                page.link.order(Order(what))
        words = navigation_words(navigation)
        if navigation.state == 'idle':
            words = navigation.reason or 'click to set a goal; drag to choose its heading'
        is_bad = navigation.state in ('refused', 'failed')
        page.widgets.words(words, style.ODOMETRY if is_bad else style.DIM, wrapped=True)

    def _draw_floor(self, page: PageState) -> tuple[Rect, bool]:
        """Draw the empty floor; return where it is, and whether a pointer is down on it."""
        room = imgui.GetContentRegionAvail()
        imgui.InvisibleButton('floor', imgui.Vec2(max(room.x, 40.0), max(room.y, 40.0)))
        rect = page.widgets.note('floor')
        is_held = bool(imgui.IsItemActive()) and page.is_there
        low, high = imgui.GetItemRectMin(), imgui.GetItemRectMax()
        imgui.GetWindowDrawList().AddRectFilled(low, high, style.colour(style.BACKGROUND), 4.0)
        return rect, is_held

    def _paint_map(
        self, page: PageState, navigation: Navigation, rect: Rect, view: FloorView
    ) -> None:
        """Paint what of the map is in sight."""
        rows, columns = navigation.cells.shape
        if self._painted != navigation.number:
            self._painted = navigation.number
            picture = paint_cells(navigation.cells)
            self._texture = page.viewer.upload_image(self._texture, picture, columns, rows, 4)
        size = (columns * navigation.resolution, rows * navigation.resolution)
        paint_image(self._texture, navigation.origin, size, rect, view)

    def _paint_way(self, navigation: Navigation, view: FloorView) -> None:
        if navigation.goal is None:
            return
        drawing, blue = imgui.GetWindowDrawList(), style.colour(style.COMMAND)
        if len(navigation.path) > 1:
            every = max(1, -(-len(navigation.path) // MOST_TRAIL))
            places = [*navigation.path[::every].tolist(), navigation.path[-1].tolist()]
            ends = [imgui.Vec2(*view.to_page(x, y)) for x, y in places]
            drawing.AddPolyline(ends, blue, 2.0)
        goal = navigation.goal
        x, y = view.to_page(goal.x, goal.y)
        drawing.AddCircle(imgui.Vec2(x, y), 7.0, blue, 16, 2.0)
        end = imgui.Vec2(x + 14.0 * math.cos(goal.yaw), y - 14.0 * math.sin(goal.yaw))
        drawing.AddLine(imgui.Vec2(x, y), end, blue, 2.0)

    def _paint_points(self, points: np.ndarray, rect: Rect, view: FloorView) -> None:
        if not len(points):
            return
        add, corner = imgui.GetWindowDrawList().AddRectFilled, imgui.Vec2
        fill = style.colour(style.LIDAR)
        places = view.all_to_page(points)
        is_seen = ((rect.left, rect.top) < places) & (places < (rect.right, rect.bottom))
        for left, top in (places[is_seen.all(axis=1)] - 2.0).tolist():
            add(corner(left, top), corner(left + 4.0, top + 4.0), fill)

    def _paint_trail(self, trail: np.ndarray, view: FloorView) -> None:
        if len(trail) < 2:
            return
        every = max(1, -(-len(trail) // MOST_TRAIL))
        places = [imgui.Vec2(*at) for at in view.all_to_page(trail[::-1][::every]).tolist()]
        imgui.GetWindowDrawList().AddPolyline(places, style.colour(style.TRUTH), 2.0)
