# SPDX-License-Identifier: Apache-2.0
"""Line charts with Pillow: axes with ticks, lines, labels; drawn large, made small and smooth."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

SCALE = 3  # drawn so many times as large as it is saved
INK, GREY, PAPER = (40, 44, 52), (208, 212, 218), (255, 255, 255)
# Lines are cut at their frame to a part of the distance between two points.
FINENESS = 100
Colour = tuple[int, int, int]


class Sheet:
    """A white sheet of a size [pixels] that axes are put on."""

    def __init__(self, width: int, height: int) -> None:
        self.size = (width, height)
        self.image = Image.new('RGB', (SCALE * width, SCALE * height), PAPER)
        self.pen = ImageDraw.Draw(self.image)

    def text(
        self,
        place: tuple[float, float],
        words: str,
        size: int = 13,
        anchor: str = 'la',
        colour: Colour = INK,
    ) -> None:
        """Write; the anchor is Pillow's, e.g. `mm` for the middle."""
        font = ImageFont.load_default(SCALE * size)
        x, y = place
        self.pen.text((SCALE * x, SCALE * y), words, font=font, anchor=anchor, fill=colour)

    def line(self, points: np.ndarray, colour: Colour, width: float, dash: float = 0.0) -> None:
        """Draw a line through points [pixels], shape (n, 2); dashes are so long, 0: none."""
        scaled = SCALE * points
        stroke = max(1, round(SCALE * width))
        pieces = _dashes(scaled, SCALE * dash) if dash else [scaled]
        for piece in pieces:
            self.pen.line([tuple(p) for p in piece.tolist()], colour, stroke, joint='curve')

    def save(self, path: Path) -> None:
        """Write a PNG of few colours."""
        small = self.image.resize(self.size, Image.Resampling.LANCZOS)
        small.quantize(128).save(path, optimize=True)


@dataclass(frozen=True)
class Axes:
    """A frame [pixels: left, top, right, bottom] and the ranges of x and y that it shows."""

    sheet: Sheet
    frame: tuple[float, float, float, float]
    x_range: tuple[float, float]
    y_range: tuple[float, float]

    def to_pixels(self, points: np.ndarray) -> np.ndarray:
        """Return points, shape (n, 2), on the sheet; y grows upward here."""
        left, top, right, bottom = self.frame
        (x0, x1), (y0, y1) = self.x_range, self.y_range
        points = np.asarray(points, dtype=float)
        x = left + (points[:, 0] - x0) / (x1 - x0) * (right - left)
        y = bottom - (points[:, 1] - y0) / (y1 - y0) * (bottom - top)
        return np.column_stack((x, y))

    def grid(self, x_ticks: Sequence[float], y_ticks: Sequence[float], form: str = 'g') -> None:
        """Draw grid, frame and numbers."""
        left, top, right, bottom = self.frame
        for tick in x_ticks:
            ((x, _),) = self.to_pixels(np.array([[tick, 0.0]]))
            self.sheet.line(np.array([[x, top], [x, bottom]]), GREY, 0.7)
            self.sheet.text((x, bottom + 5), format(tick, form), 11, 'ma')
        for tick in y_ticks:
            ((_, y),) = self.to_pixels(np.array([[0.0, tick]]))
            self.sheet.line(np.array([[left, y], [right, y]]), GREY, 0.7)
            self.sheet.text((left - 6, y), format(tick, form), 11, 'rm')
        box = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]]
        self.sheet.line(np.array(box), INK, 1.0)

    def name(self, title: str, x_name: str, y_name: str) -> None:
        """Write what this shows and what its axes are."""
        left, top, right, bottom = self.frame
        self.sheet.text((left, top - 10), title, 14, 'ls')
        self.sheet.text((right, bottom + 21), x_name, 12, 'ra')
        self.sheet.text((left + 6, top + 5), y_name, 12, 'la')

    def line(self, points: np.ndarray, colour: Colour, width: float, dash: float = 0.0) -> None:
        """Draw a line through points in the units of the axes; what is outside is left out."""
        for piece in self._clipped(points):
            self.sheet.line(self.to_pixels(piece), colour, width, dash)

    def dot(self, point: Sequence[float], colour: Colour, radius: float) -> None:
        """Draw a dot at a point."""
        ((x, y),) = SCALE * self.to_pixels(np.array([point]))
        r = SCALE * radius
        self.sheet.pen.ellipse(
            (x - r, y - r, x + r, y + r), fill=colour, outline=PAPER, width=SCALE
        )

    def _clipped(self, points: np.ndarray) -> list[np.ndarray]:
        """Return what is inside the frame, cut to about a pixel."""
        (x0, x1), (y0, y1) = self.x_range, self.y_range
        fine = np.linspace(0, len(points) - 1, FINENESS * (len(points) - 1) + 1)
        x, y = (np.interp(fine, np.arange(len(points)), points[:, axis]) for axis in (0, 1))
        inside = (x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)
        edges = np.flatnonzero(np.diff(inside.astype(int))) + 1
        pieces = np.split(np.column_stack((x, y)), edges)
        return [piece for piece in pieces[0 if inside[0] else 1 :: 2] if len(piece) > 1]


def _dashes(points: np.ndarray, length: float) -> list[np.ndarray]:
    """Cut a line into dashes with gaps as long, measured along it."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.concatenate(([0.0], np.cumsum(steps)))
    if along[-1] == 0.0:
        return []
    at = np.arange(0.0, along[-1], length)
    cut = np.column_stack([np.interp(at, along, points[:, axis]) for axis in (0, 1)])
    return [cut[index : index + 2] for index in range(0, len(cut) - 1, 2)]
