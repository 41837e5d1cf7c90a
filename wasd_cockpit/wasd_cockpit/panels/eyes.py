# SPDX-License-Identifier: Apache-2.0
"""The panel Eyes: the picture from the robot's front, or the elevation that it has mapped."""

from mujoco.studio.dear_imgui import dear_imgui as imgui
import numpy as np

from wasd_cockpit import style
from wasd_cockpit.heights import height_colours, height_scale, LEAST_SPAN, paint_heights
from wasd_cockpit.link import Elevation, Snapshot
from wasd_cockpit.panels.floor import FloorView, paint_grid, paint_image, paint_robot
from wasd_cockpit.panels.page_panel import PageState
from wasd_cockpit.sight import SIZE
from wasd_cockpit.widgets import in_rows

_SCALE_HEIGHT, _FOOT = 8.0, 4.0


class Eyes:
    """Shows one of both, or neither: a picture is 300 kB, an elevation 40 kB."""

    def __init__(self) -> None:
        self.shown = ''
        self._picture, self._number = 0, 0
        self._heights = _Heights()

    def draw(self, page: PageState, snapshot: Snapshot) -> None:
        """Draw it in the window that is open."""
        refusals = {'picture': page.sight.failure, 'elevation': snapshot.no_elevation}
        for name, refusal in in_rows(refusals.items(), gap=8.0):
            is_on = name == self.shown
            if page.widgets.toggle(name, name, is_on, (0.0, 26.0), refusal=refusal):
                self.shown = '' if is_on else name
        if page.sight.failure:
            page.widgets.words(page.sight.failure, style.ODOMETRY, wrapped=True)
        if self.shown and not refusals[self.shown]:
            draw = self._draw_picture if self.shown == 'picture' else self._heights.draw
            draw(page, snapshot)
        elif not self.shown:
            page.widgets.words('Five pictures a second are 1.5 MB.', style.DIM, wrapped=True)

    def _draw_picture(self, page: PageState, snapshot: Snapshot) -> None:
        page.sight.want('picture')
        seen = page.sight.seen
        if seen.picture is not None and seen.number != self._number:
            self._number = seen.number
            self._picture = page.viewer.upload_image(self._picture, seen.picture, *SIZE, 4)
        if not self._picture:
            page.widgets.words('looking ...', style.DIM)
            return
        room = imgui.GetContentRegionAvail()
        width = max(min(room.x, room.y * SIZE[0] / SIZE[1]), 32.0)
        imgui.Image(self._picture, imgui.Vec2(width, width * SIZE[1] / SIZE[0]))
        page.widgets.note('shown picture')


class _Heights:
    """Draws an elevation from above, in odometry's axes, with its scale."""

    def __init__(self) -> None:
        self._texture, self._number = 0, -1
        self._scale = 0.0, LEAST_SPAN

    def draw(self, page: PageState, snapshot: Snapshot) -> None:
        """Draw it in the window that is open."""
        page.link.look()
        elevation = snapshot.elevation
        if elevation is None:
            page.widgets.words('looking ...', style.DIM)
            return
        rows, columns = elevation.heights.shape
        if elevation.number != self._number:
            self._number, self._scale = elevation.number, height_scale(elevation.heights)
            picture = paint_heights(elevation.heights, *self._scale)
            self._texture = page.viewer.upload_image(self._texture, picture, columns, rows, 4)
        self._draw_scale(page)
        room = imgui.GetContentRegionAvail()
        imgui.Dummy(imgui.Vec2(max(room.x, 40.0), max(room.y, 40.0)))
        rect = page.widgets.note('shown elevation')
        low, high = imgui.GetItemRectMin(), imgui.GetItemRectMax()
        imgui.GetWindowDrawList().AddRectFilled(low, high, style.colour(style.BACKGROUND), 4.0)
        imgui.PushClipRect(low, high, True)
        view = FloorView(rect, elevation.pose, 0.5 * rows * elevation.resolution)
        size = (columns * elevation.resolution, rows * elevation.resolution)
        paint_image(self._texture, elevation.corner, size, rect, view)
        paint_grid(rect, view)
        paint_robot(snapshot.marks.size, elevation.pose, view)
        self._paint_feet(elevation, view)
        imgui.PopClipRect()

    def _draw_scale(self, page: PageState) -> None:
        """Draw a bar of all colours between the heights of its ends."""
        low, high = self._scale
        page.widgets.words(f'{low:+.1f} m', style.DIM)
        page.widgets.note('text lowest')
        imgui.SameLine(0.0, 8.0)
        words = f'{high:+.1f} m'
        width = max(imgui.GetContentRegionAvail().x - imgui.CalcTextSize(words).x - 8.0, 10.0)
        at = imgui.GetCursorScreenPos()
        top = at.y + 0.5 * (imgui.GetTextLineHeight() - _SCALE_HEIGHT)
        drawing, parts = imgui.GetWindowDrawList(), 40
        for part, rgb in enumerate(height_colours(np.linspace(low, high, parts), low, high)):
            left, right = (at.x + width * share / parts for share in (part, part + 1))
            fill = style.colour(tuple(rgb.tolist()))
            drawing.AddRectFilled(
                imgui.Vec2(left, top), imgui.Vec2(right, top + _SCALE_HEIGHT), fill
            )
        imgui.Dummy(imgui.Vec2(width, imgui.GetTextLineHeight()))
        imgui.SameLine(0.0, 8.0)
        page.widgets.words(words, style.DIM)
        page.widgets.note('text highest')

    def _paint_feet(self, elevation: Elevation, view: FloorView) -> None:
        """Paint the feet, and where those that swing are to land."""
        drawing = imgui.GetWindowDrawList()
        for places, rgb in ((elevation.feet, style.TEXT), (elevation.footholds, style.FOOTHOLD)):
            for x, y in view.all_to_page(places).tolist():
                drawing.AddCircleFilled(imgui.Vec2(x, y), _FOOT, style.colour(rgb))
                drawing.AddCircle(imgui.Vec2(x, y), _FOOT, style.colour(style.BACKGROUND), 12, 1.0)
