# SPDX-License-Identifier: Apache-2.0
"""The panel Plots: the last seconds of velocities, torques, feet, and pace."""

from collections.abc import Iterator, Sequence

from mujoco.studio.dear_imgui import dear_imgui as imgui
from mujoco.studio.implot import implot
import numpy as np

from wasd_cockpit import style
from wasd_cockpit.link import Columns, Snapshot, SPAN
from wasd_cockpit.panels.page_panel import PageState
from wasd_cockpit.widgets import in_rows, Rect

PAGES = ('velocity', 'torque', 'feet', 'pace')
# Points of a line, at most: more are not seen.
MOST_POINTS = 100
_FLAGS = style.flags(
    implot.Flags, 'NoMenus', 'NoBoxSelect', 'NoMouseText', 'NoTitle', 'NoInputs', 'NoLegend'
)
_X, _Y = int(implot.Axis.X1.value), int(implot.Axis.Y1.value)
_ALWAYS = int(implot.Cond.Always.value)
_NO_LABELS = int(implot.AxisFlags.NoTickLabels.value)
_BACKGROUND = (
    (int(implot.Col.FrameBg.value), style.colour(style.PANEL, 0.0)),
    (int(implot.Col.PlotBg.value), style.colour(style.BACKGROUND)),
    (int(implot.Col.LegendBg.value), style.colour(style.PANEL, 0.6)),
)
_PADDING = int(implot.StyleVar.PlotPadding.value)
# How far up a plot goes at least, for each part of the velocity [m/s], [m/s], [rad/s].
_LEAST_RANGE = (0.5, 0.5, 1.0)
_BAR_HEIGHT = 16.0
# Plots side by side are at least so wide, unless below each other they were lower than this; and
# so far apart [pixels].
_LEAST_PLOT, _LEAST_HEIGHT, _GAP = 140.0, 60.0, 4.0
# What a label beside a plot needs more than its words [pixels].
_LABEL_MARGIN = 16.0


def thin(history: np.ndarray) -> np.ndarray:
    """Return every so many-th row, at most MOST_POINTS, the last one among them."""
    every = max(1, -(-len(history) // MOST_POINTS))
    return history[::-1][::every][::-1]


def runs(times: np.ndarray, flags: np.ndarray) -> list[tuple[int, float, float]]:
    """Return which of the flags, shape (n, m), is set from when until when [s] without a break."""
    padded = np.zeros((flags.shape[1], len(flags) + 2), dtype=np.int8)
    padded[:, 1:-1] = flags.T > 0.5
    edges = np.diff(padded)
    (which, begins), (_, ends) = np.nonzero(edges > 0), np.nonzero(edges < 0)
    ends = np.minimum(ends, len(times) - 1)
    columns = which.tolist(), times[begins].tolist(), times[ends].tolist()
    return list(zip(*columns, strict=True))


class Plots:
    """Draws one of several pages of plots."""

    def __init__(self) -> None:
        self.page = PAGES[0]

    def draw(self, page: PageState, snapshot: Snapshot) -> None:
        """Draw it in the window that is open."""
        page.beside_tabs(16.0)
        for name in in_rows(PAGES, gap=4.0):
            if page.widgets.toggle(f'plot {name}', name, name == self.page, (0.0, 26.0)):
                self.page = name
        self._draw_legend(page, snapshot)
        history = snapshot.history
        if len(history) < 2:
            page.widgets.words('nothing yet', style.DIM)
            return
        room = imgui.GetContentRegionAvail()
        for index, value in _BACKGROUND:
            implot.PushStyleColor(index, value)
        implot.PushStyleVar(_PADDING, imgui.Vec2(4.0, 4.0))
        draw = {
            'velocity': self._draw_velocity,
            'torque': self._draw_torque,
            'feet': self._draw_feet,
            'pace': self._draw_pace,
        }[self.page]
        draw(page, snapshot, room.x, max(room.y, 60.0))
        implot.PopStyleVar(1)
        implot.PopStyleColor(len(_BACKGROUND))

    def _draw_legend(self, page: PageState, snapshot: Snapshot) -> None:
        """Say which colour is what, beside the pages' names."""
        words: tuple[str, ...] = snapshot.columns.feet
        if self.page == 'velocity':
            words = ('command', 'odometry', 'truth')
        elif self.page == 'pace':
            words = ()
        elif not words:
            words = snapshot.columns.motors
        if words:
            page.beside_tabs(24.0)
        for word, rgb in in_rows(zip(words, style.LINES, strict=False), gap=10.0):
            text = word.removesuffix('_joint')
            if imgui.GetContentRegionAvail().x < imgui.CalcTextSize(text).x:
                imgui.NewLine()
            imgui.AlignTextToFramePadding()
            page.widgets.words(text, rgb)
            page.widgets.note(f'text legend {text}')

    def _draw_velocity(
        self, page: PageState, snapshot: Snapshot, width: float, height: float
    ) -> None:
        rows = thin(snapshot.history)
        names = ('forward m/s', 'left m/s', 'turn rad/s')
        for part, size in enumerate(_cells(len(names), width, height)):
            name = names[part]
            # In the order of ImPlot's colours, which are those of the map and the scene.
            lines = {
                'command': rows[:, Columns.COMMAND + part],
                'odometry': rows[:, Columns.ODOMETRY + part],
                'truth': rows[:, Columns.TRUTH + part],
            }
            most = 1.15 * max(float(np.abs(line).max()) for line in lines.values())
            most = max(most, _LEAST_RANGE[part])
            _plot(name, size, rows[:, 0], lines, (-most, most))
            page.widgets.note(f'plot of {name}')

    def _draw_torque(
        self, page: PageState, snapshot: Snapshot, width: float, height: float
    ) -> None:
        rows, columns = thin(snapshot.history), snapshot.columns
        count = len(columns.motors)
        groups = max(1, count // 4) if columns.feet else 1
        # Of legs: all hips, all thighs, all calves; four lines each.
        for group, size in enumerate(_cells(groups, width, height)):
            motors = range(group, count, groups)
            lines = {columns.motors[motor]: rows[:, columns.torques + motor] for motor in motors}
            joint = columns.motors[group].removesuffix('_joint').rpartition('_')[2]
            words = f'{joint} / limit' if columns.feet else 'torque / limit'
            _plot(words, size, rows[:, 0], lines, (-1.05, 1.05))
            page.widgets.note(f'plot of torque {group}')

    def _draw_feet(self, page: PageState, snapshot: Snapshot, width: float, height: float) -> None:
        columns = snapshot.columns
        if not columns.feet:
            page.widgets.words('this robot has no feet', style.DIM)
            return
        rows = thin(snapshot.history)
        lines = {foot: rows[:, columns.FORCES + index] for index, foot in enumerate(columns.feet)}
        most = max(60.0, 1.1 * max(float(line.max()) for line in lines.values()))
        cells = _cells(2, width, height)
        size = next(cells)
        _plot('force N', size, rows[:, 0], lines, (0.0, most))
        page.widgets.note('plot of forces')
        imgui.InvisibleButton('gait', imgui.Vec2(*next(cells)))
        self._paint_stances(snapshot, page.widgets.note('plot of gait'))

    def _paint_stances(self, snapshot: Snapshot, rect: Rect) -> None:
        """Paint when each foot was to stand, the newest at the right."""
        drawing, columns = imgui.GetWindowDrawList(), snapshot.columns
        corners = imgui.Vec2(rect.left, rect.top), imgui.Vec2(rect.right, rect.bottom)
        drawing.AddRectFilled(*corners, style.colour(style.BACKGROUND), 4.0)
        # A gait is faster than ten seconds: two of them.
        times = snapshot.history[:, 0]
        end = float(times[-1])
        begin, left = end - 2.0, rect.left + 34.0
        scale = (rect.right - left - 6.0) / 2.0
        first, stances = int(np.searchsorted(times, begin)), columns.stances
        flags = snapshot.history[first:, stances : stances + len(columns.feet)]
        step = rect.height / max(1, len(columns.feet))
        half = min(_BAR_HEIGHT, 0.7 * step) / 2.0
        for index, foot in enumerate(columns.feet):
            middle = rect.top + (index + 0.5) * step
            place = imgui.Vec2(rect.left + 6.0, middle - 8.0)
            drawing.AddText(place, style.colour(style.DIM), foot)
        for index, since, until in runs(times[first:], flags):
            middle = rect.top + (index + 0.5) * step
            drawing.AddRectFilled(
                imgui.Vec2(left + scale * (since - begin), middle - half),
                imgui.Vec2(left + scale * (until - begin), middle + half),
                style.colour(style.LINES[index % len(style.LINES)]),
                3.0,
            )

    def _draw_pace(self, page: PageState, snapshot: Snapshot, width: float, height: float) -> None:
        rows = thin(snapshot.history)
        shown = (('controller ms', Columns.TICK, 1.0), ('real-time factor', Columns.PACE, 1.2))
        for index, size in enumerate(_cells(len(shown), width, height)):
            name, first, least = shown[index]
            line = rows[:, first]
            most = max(least, 1.1 * float(line.max()))
            _plot(name, size, rows[:, 0], {name: line}, (0.0, most))
            page.widgets.note(f'plot of {name}')


def _cells(count: int, width: float, height: float) -> Iterator[tuple[float, float]]:
    """Yield the size of each of some plots, put beside the one before where there is room."""
    is_row = width >= count * _LEAST_PLOT or height < count * _LEAST_HEIGHT
    rest = 1.0 - _GAP * (count - 1) / (width if is_row else height)
    for index in range(count):
        if index and is_row:
            imgui.SameLine(0.0, _GAP)
        yield (rest * width / count, height) if is_row else (width, rest * height / count)


def _plot(
    name: str,
    size: tuple[float, float],
    times: np.ndarray,
    lines: dict[str, np.ndarray],
    limits: Sequence[float],
) -> None:
    """Draw lines over the last SPAN seconds; a name longer than the plot is high is in it."""
    has_label = size[1] >= imgui.CalcTextSize(name).x + _LABEL_MARGIN
    if not implot.BeginPlot(f'##{name}', imgui.Vec2(*size), _FLAGS):
        return
    implot.SetupAxis(_X, None, _NO_LABELS)
    implot.SetupAxis(_Y, name if has_label else None, 0)
    end = float(times[-1])
    implot.SetupAxisLimits(_X, -SPAN, 0.0, _ALWAYS)
    implot.SetupAxisLimits(_Y, limits[0], limits[1], _ALWAYS)
    ago = (times - end).tolist()
    for label, line in lines.items():
        implot.PlotLine(f'##{label}', ago, line.tolist())
    if not has_label:
        corner = implot.GetPlotPos()
        place = imgui.Vec2(corner.x + 4.0, corner.y + 1.0)
        imgui.GetWindowDrawList().AddText(place, style.colour(style.DIM), name)
    implot.EndPlot()
