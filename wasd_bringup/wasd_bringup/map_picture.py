# SPDX-License-Identifier: Apache-2.0
"""A picture of a map, with the way that was driven in it and its goals."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image
from PIL import ImageDraw
from wasd_navigation.grid import Grid

# A cell is so many pixels wide; colours of unknown, free, occupied, the way, goals.
SCALE = 4
RIM = 10  # cells
COLOURS = np.array(((205, 208, 212), (255, 255, 255), (30, 34, 40)), dtype=np.uint8)
WAY, GOAL = (235, 115, 20), (30, 110, 220)


def known_part(grid: Grid) -> Grid:
    """Return the part of a grid of which something is known, with a rim of unknown cells."""
    rows, columns = (np.flatnonzero((grid.cells >= 0).any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return grid
    low = max(rows[0] - RIM, 0), max(columns[0] - RIM, 0)
    cells = grid.cells[low[0] : rows[-1] + RIM, low[1] : columns[-1] + RIM]
    x, y = np.array(grid.origin) + grid.resolution * np.array(low[::-1])
    return Grid(cells, grid.resolution, (float(x), float(y)))


def draw_map(grid: Grid, way: np.ndarray, goals: Sequence[Sequence[float]], path: Path) -> None:
    """
    Write a picture of a map; `way` (n, 2) and `goals` (x, y, ...) are in its axes [m].

    Raises:
        OSError: it cannot be written.
    """
    grid = known_part(grid)
    kinds = np.where(grid.cells < 0, 0, np.where(grid.cells > 50, 2, 1))
    pixels = COLOURS[kinds[::-1]].repeat(SCALE, axis=0).repeat(SCALE, axis=1)
    image = Image.fromarray(pixels)
    drawing = ImageDraw.Draw(image)

    def place(x: float, y: float) -> tuple[float, float]:
        column, row = ((x, y) - np.array(grid.origin)) / grid.resolution * SCALE
        return float(column), float(image.height - row)

    drawing.line([place(x, y) for x, y in way.tolist()], fill=WAY, width=SCALE)
    for goal in goals:
        drawing.circle(place(*goal[:2]), 2 * SCALE, outline=GOAL, width=SCALE)
    image.save(path)
