# SPDX-License-Identifier: Apache-2.0
"""Drawings of what a robot has mapped: its map with its way and goals, its elevation."""

from dataclasses import replace
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw
from wasd_cockpit.heights import height_colours, height_scale, paint_heights

from wasd_bringup.run.go2 import Go2

if TYPE_CHECKING:
    from wasd_navigation.records import Grid

    from wasd_bringup.run.navigation import NavigationDriver

# A cell of a map is so many pixels wide; colours of unknown, free, occupied, the way, goals.
MAP_SCALE = 4
MAP_RIM = 10  # cells
MAP_COLOURS = np.array(((205, 208, 212), (255, 255, 255), (30, 34, 40)), dtype=np.uint8)
MAP_WAY, MAP_GOAL = (235, 115, 20), (30, 110, 220)
# An elevation is drawn as on the page; below it a scale, so high [pixels].
BACKGROUND, LIGHT, FEET, SCALE_HEIGHT = (17, 20, 26), (224, 229, 236), (255, 255, 255), 26


def draw_navigation(navigation: 'NavigationDriver', report: dict[str, Any], path: Path) -> None:
    """
    Write a picture of what a navigator has mapped, and where it has driven.

    Raises:
        OSError: it cannot be written.
    """
    way = np.array(report['samples']['position'])[::10, :2]
    grid = _known_part(navigation.navigator.locator.grid)
    kinds = np.where(grid.cells < 0, 0, np.where(grid.cells > 50, 2, 1))
    pixels = MAP_COLOURS[kinds[::-1]].repeat(MAP_SCALE, axis=0).repeat(MAP_SCALE, axis=1)
    image = Image.fromarray(pixels)
    drawing = ImageDraw.Draw(image)

    def place(x: float, y: float) -> tuple[float, float]:
        column, row = ((x, y) - np.array(grid.origin)) / grid.resolution * MAP_SCALE
        return float(column), float(image.height - row)

    drawing.line([place(x, y) for x, y in way.tolist()], fill=MAP_WAY, width=MAP_SCALE)
    for goal in report['navigation']['goals']:
        drawing.circle(place(*goal['goal'][:2]), 2 * MAP_SCALE, outline=MAP_GOAL, width=MAP_SCALE)
    image.save(path)


def _known_part(grid: 'Grid') -> 'Grid':
    """Return the known part of a grid, with a rim of unknown cells."""
    rows, columns = (np.flatnonzero((grid.cells >= 0).any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return grid
    low = max(rows[0] - MAP_RIM, 0), max(columns[0] - MAP_RIM, 0)
    cells = grid.cells[low[0] : rows[-1] + MAP_RIM, low[1] : columns[-1] + MAP_RIM]
    x, y = np.array(grid.origin) + grid.resolution * np.array(low[::-1])
    return replace(grid, cells=cells, origin=(float(x), float(y)))


def draw_elevation(robot: Go2, path: Path) -> None:
    """
    Write a picture of the heights that a robot has mapped around it, with its feet and a scale.

    Raises:
        OSError: it cannot be written.
    """
    mapper, legs = robot.elevation.mapper, robot.legs.controller.robot
    assert mapper is not None
    assert legs is not None
    elevation, heights = mapper.elevation, mapper.elevation.heights()
    low, high = height_scale(heights)
    painted = np.frombuffer(paint_heights(heights, low, high), np.uint8)
    side = MAP_SCALE * elevation.count
    cells = Image.frombytes('RGBA', heights.shape, painted).resize(
        (side, side), Image.Resampling.NEAREST
    )
    image = Image.new('RGB', (side, side + SCALE_HEIGHT), BACKGROUND)
    image.paste(cells, (0, 0), cells)
    drawing = ImageDraw.Draw(image)

    def place(point: np.ndarray) -> tuple[float, float]:
        column, row = (point - elevation.corner) / elevation.resolution * MAP_SCALE
        return float(column), float(side - row)

    front, rear = legs.feet[:2, :2].mean(axis=0), legs.feet[2:, :2].mean(axis=0)
    ahead = (front - rear) / np.linalg.norm(front - rear)
    aside = np.array((-ahead[1], ahead[0]))
    head = (front + 0.15 * ahead, front + 0.05 * aside, front - 0.05 * aside)
    drawing.line([place(front), place(rear)], fill=FEET, width=MAP_SCALE)
    drawing.polygon([place(corner) for corner in head], fill=FEET)
    for foot in legs.feet[:, :2]:
        drawing.circle(place(foot), 1.5 * MAP_SCALE, fill=FEET, outline=BACKGROUND)
    words, middle = (f'{low:+.1f} m', f'{high:+.1f} m'), side + SCALE_HEIGHT // 2
    drawing.text((8, middle), words[0], LIGHT, anchor='lm')
    drawing.text((side - 8, middle), words[1], LIGHT, anchor='rm')
    scale = height_colours(np.linspace(low, high, side - 120), low, high)
    bar = np.broadcast_to(scale, (8, *scale.shape))
    image.paste(Image.fromarray(np.ascontiguousarray(bar)), (60, middle - 4))
    image.save(path, optimize=True)
